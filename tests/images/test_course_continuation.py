"""The path tracing continuation of the course format: scenes of our own against closed forms and one another."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr

# The square [-1, 1]² at y = 1, which shines down, and a floor under it; the eye looks at (0, -1, 0).
SQUARE = """\
size 1 1
camera 3 0 0  0 -1 0  0 1 0  .001
integrator {}
{}
quadLight -1 1 -1  0 0 2  2 0 0  1 2 3
ambient .5 .5 .5
diffuse .5 .5 .5
{}
vertex -9 -1 -9
vertex -9 -1 9
vertex 9 -1 9
vertex 9 -1 -9
tri 0 1 2
tri 0 2 3
"""
EXACT = 0.7522746885 * 0.5 / math.pi * np.array([1, 2, 3])


def picture(tmp_path, text, **options):
    path = tmp_path / "scene.test"
    path.write_text(text)
    return np.asarray(sr.render(sr.load(path), **options))


def test_analytic_direct_is_kd_over_pi_times_lambert(tmp_path):
    np.testing.assert_allclose(picture(tmp_path, SQUARE.format("analyticdirect", "", ""))[0, 0], EXACT, rtol=1e-6)


@pytest.mark.parametrize("more", ["lightsamples 16\nlightstratify on", "lightsamples 16", ""])
def test_direct_tends_to_the_exact_light(tmp_path, more):
    found = [picture(tmp_path, SQUARE.format("direct", more, ""), samples=16, seed=k)[0, 0] for k in range(32)]
    error = np.std(found, axis=0, ddof=1) / math.sqrt(32)
    assert (np.abs(np.mean(found, axis=0) - EXACT) < 4 * error).all()
    assert (error < 0.01 * EXACT).all()


def test_stratified_light_samples_are_less_noisy(tmp_path):
    on, off = (
        np.std([
            picture(tmp_path, SQUARE.format("direct", f"lightsamples 64\nlightstratify {word}", ""), seed=k)[0, 0, 0]
            for k in range(24)
        ])
        for word in ("on", "off")
    )  # fmt: skip
    assert on < 0.5 * off


@pytest.mark.parametrize("nee", ["on", "off", "mis"])
@pytest.mark.parametrize("way", ["hemisphere", "cosine", "brdf"])
@pytest.mark.parametrize("brdf", ["phong", "ggx"])
def test_every_switch_of_the_path_tracer_gives_one_picture(tmp_path, nee, way, brdf):
    """One bounce on a glossy floor: what `direct` finds, by any combination of switches."""
    gloss = f"specular .4 .4 .4\nshininess 8\nbrdf {brdf}\nroughness .5"
    truth = picture(tmp_path, SQUARE.format("direct", "lightsamples 1024\nlightstratify on", gloss), samples=64)[0, 0]
    switches = f"nexteventestimation {nee}\nimportancesampling {way}\nrussianroulette on\nmaxdepth 1"
    found = [
        picture(tmp_path, SQUARE.format("pathtracer", switches, gloss), samples=128, seed=k)[0, 0] for k in range(24)
    ]
    error = np.std(found, axis=0, ddof=1) / math.sqrt(24)
    assert (np.abs(np.mean(found, axis=0) - truth) < 4 * error + 1e-3 * truth).all()


def test_ggx_is_the_formula_of_the_lecture(tmp_path):
    """A sun from l on a floor seen from v shows kd/pi + F D G1 G1 / (4 cos cos), times its irradiance cos."""
    body = "directional 1 2 0.5  1 1 1\nspecular .3 .6 .1\nbrdf ggx\nroughness 0.4"
    text = SQUARE.format("direct", "", body).replace("quadLight", "# quadLight")
    light, v = np.array([1, 2, 0.5]), np.array([3.0, 1, 0])
    light, v = light / np.linalg.norm(light), v / np.linalg.norm(v)
    h = (light + v) / np.linalg.norm(light + v)

    def g1(w):
        return 2 / (1 + math.sqrt(1 + 0.4**2 * (1 / w[1] ** 2 - 1)))

    d = 0.4**2 / (math.pi * (h[1] ** 2 * (0.4**2 - 1) + 1) ** 2)
    ks = np.array([0.3, 0.6, 0.1])
    fresnel = ks + (1 - ks) * (1 - light @ h) ** 5
    expected = 0.5 / math.pi + fresnel * d * g1(light) * g1(v) / (4 * light[1] * v[1])
    np.testing.assert_allclose(picture(tmp_path, text)[0, 0], expected * light[1], rtol=1e-5)


def test_gamma_bends_the_bytes(tmp_path):
    path = tmp_path / "scene.test"
    path.write_text(SQUARE.format("analyticdirect", "gamma 2.2", ""))
    image = sr.render(sr.load(path))
    assert image.to_bytes()[0, 0].tolist() == np.floor(255 * EXACT ** (1 / 2.2)).tolist()
