"""What ends a render, where samples go, and what the film says of its own error."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import sightray as sr
from sightray._jit import implements
from sightray.cameras.base import Ray
from sightray.engine.adaptive import ErrorDriven, allotted, relative_error
from sightray.engine.run import run
from sightray.engine.schedule import Contrast, Uniform
from sightray.film.film import Film, add_sample, averaged
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3, grey
from sightray.samplers.base import Draws, pair
from sightray.scene.compile import compile_scene
from sightray.scenes import build

LUMINANCE = [0.2126, 0.7152, 0.0722]


def cornell(size=48):
    scene = build("cornell")
    return scene.replace(camera=scene.camera.resized(size, size))


class Grain(Integrator):
    """Noise of known size: the left half of the picture is 0.5 +- 0.5 evenly, the right half 0.5 +- 0.05."""


@implements(radiance, Grain)
def grain(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    size = 1.0 if ray.origin.x < 0.0 else 0.1
    return Radiance(grey(0.5 + size * (pair(draws, 5).u - 0.5)), 1)


class Broken(Integrator):
    """Not a number for a tenth of all samples, infinite for another, else 1."""


@implements(radiance, Broken)
def broken(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    u = pair(draws, 5).u
    if u < 0.1:
        return Radiance(Vec3(math.sqrt(-u), 1.0, 1.0), 1)
    if u < 0.2:
        return Radiance(Vec3(1.0, 1.0 / (u - u), 1.0), 1)
    return Radiance(grey(1.0), 1)


def wall(width=64, height=64):
    camera = sr.OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), view_height=4, width=width, height=height)
    return sr.Scene(sr.Rectangle(corner=(-9, -9, 0), edge_u=(18, 0, 0), edge_v=(0, 18, 0)), camera=camera)


def test_samples_end_a_render():
    image = sr.render(wall(), Grain(), samples=10)
    assert image.info["stopped"] == "samples"
    assert (image.info["sample_count"] == 10).all()
    assert image.info["samples"] == 10


def test_passes_grow_and_do_not_change_the_picture():
    """1, 4, 16 ... or smaller steps where the end is open; the same samples in the same order."""
    film = Film(2, 2)

    def steps(schedule):
        reached, found = None, []
        while (reached := schedule.next(film, reached)) is not None and len(found) < 12:
            found.append(int(reached.max()))
        return found

    assert steps(Uniform(50)) == [1, 4, 16, 50]
    assert steps(Uniform(open_ended=True))[:8] == [1, 2, 4, 8, 16, 24, 36, 54]
    assert steps(Contrast(9, 9, 0.1)) == steps(Uniform(9)) == [1, 4, 9]
    scene = cornell(24)
    known = sr.render(scene, sr.PathTracer(), samples=30)
    capped = sr.render(scene, sr.PathTracer(), samples=30, time=1e6)
    assert (np.asarray(known) == np.asarray(capped)).all()


def test_time_ends_a_render():
    image = sr.render(cornell(), sr.PathTracer(), time=0.5)
    assert image.info["stopped"] == "time"
    assert image.info["complete"]
    assert image.info["seconds"] >= 0.5
    assert image.info["sample_count"].min() >= 1
    # One sample of each pixel is taken even where there is no time for it.
    image = sr.render(cornell(128), sr.PathTracer(), time=1e-6)
    assert image.info["stopped"] == "time"
    assert (image.info["sample_count"] == 1).all()


def test_whichever_limit_comes_first_ends_a_render():
    assert sr.render(wall(), Grain(), samples=3, time=1e6, target_error=1e-9).info["stopped"] == "samples"
    assert sr.render(wall(), Grain(), samples=1 << 20, time=0.3, target_error=1e-9).info["stopped"] == "time"
    assert sr.render(wall(), Grain(), time=1e6, target_error=0.1).info["stopped"] == "target_error"


def test_target_error_is_the_error():
    """Against the true error: left pixels 1/sqrt(12), right ones a tenth of it, over root n, relative to 0.5."""
    image = sr.render(wall(), Grain(), target_error=0.05, sampler=sr.IndependentSampler())
    assert image.info["stopped"] == "target_error"
    assert 0.03 < image.info["error"] <= 0.05
    wrong = (np.asarray(image)[..., 1] - 0.5) / np.sqrt(0.5**2 + 0.05**2)
    assert np.sqrt((wrong**2).mean()) == pytest.approx(image.info["error"], rel=0.1)


def test_even_samples_are_credited_for_it():
    """Sobol's error on this smooth function falls as n^-1.5. The estimate sees that samples fall more evenly than by
    chance, and errs to the safe side: it supposes that the error goes on as n^-0.5 from the last pass."""
    for samples in (16, 64, 256):
        image = sr.render(wall(), Grain(), samples=samples)
        true = np.sqrt((((np.asarray(image)[..., 1] - 0.5) / np.sqrt(0.5**2 + 0.05**2)) ** 2).mean())
        chance = np.sqrt((1 + 0.01) / 2 / 12 / samples) / 0.5
        assert true < 0.1 * chance
        assert 0.9 < image.info["error"] / true < 6, samples
        assert image.info["error"] < 0.4 * chance, samples


def test_samples_go_where_the_error_is():
    """Ten times the noise asks for ten times the samples (J. Neyman, 1934), within the floor of a tenth of the mean."""
    image = sr.render(wall(), Grain(), samples=100, adaptive="error", sampler=sr.IndependentSampler())
    counts = image.info["sample_count"].astype(float)
    assert image.info["samples"] == pytest.approx(100, rel=0.01)
    assert counts[:, :26].mean() / counts[:, 38:].mean() == pytest.approx(10, rel=0.15)
    plain = sr.render(wall(), Grain(), samples=100, sampler=sr.IndependentSampler())
    assert image.info["error"] < 0.85 * plain.info["error"]  # root (2 / 1.1²) less at best: 0.78
    capped = sr.render(wall(), Grain(), samples=50, adaptive="error", max_samples=60).info["sample_count"]
    assert capped.max() == 60


def test_allotted_samples_add_up():
    demand = np.random.default_rng(0).uniform(0.1, 5, (20, 30))
    reached = np.full((20, 30), 16)
    found = allotted(demand, reached, 600 * 40)
    assert found.sum() == pytest.approx(600 * 40, rel=0.01)
    assert (found >= reached).all()
    more = found > 17
    np.testing.assert_allclose(found[more] / demand[more], (found[more] / demand[more]).mean(), rtol=0.05)


def test_averages_are_those_of_squares():
    values = np.random.default_rng(1).uniform(size=(7, 9))
    for y, x in ((0, 0), (3, 4), (6, 8), (2, 7)):
        square = values[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3]
        assert averaged(values, 2)[y, x] == pytest.approx(square.mean(), rel=1e-12)


def test_adaptive_pictures_are_right():
    """Against a picture of many samples: no darkening of the whole, and pixels off as far as they say."""
    scene, tracer = cornell(24), sr.PathTracer(max_depth=2)
    exact = np.asarray(sr.render(scene, tracer, samples=2048), float) @ LUMINANCE
    image = sr.render(scene, tracer, target_error=0.08, sampler=sr.IndependentSampler())
    error = image.info["standard_error"]
    wrong = np.asarray(image, float) @ LUMINANCE - exact
    assert abs(wrong.sum()) < 4 * np.sqrt((error**2).sum())
    lit = error > 1e-6
    assert np.median(np.abs(wrong[lit]) / error[lit]) == pytest.approx(0.674, abs=0.1)


def test_variance_is_that_of_the_samples():
    """Of luminance, by the textbook; the standard error without a mark is its root over root n."""
    film = Film(2, 1)
    values = np.random.default_rng(5).uniform(0, 3, (7, 3))
    for color in values:
        add_sample(film.table, 1, Vec3(*color), 1.0)
    expected = (values @ LUMINANCE).var(ddof=1)
    assert film.variance()[0, 1] == pytest.approx(expected, rel=1e-12)
    assert film.standard_error()[0, 1] == pytest.approx(math.sqrt(expected / 7), rel=1e-12)
    assert film.luminance()[0].tolist() == pytest.approx([0, (values @ LUMINANCE).mean()])


def test_standard_error_is_that_of_many_renders():
    compiled = compile_scene(cornell(24))
    films = [run(compiled, sr.PathTracer(max_depth=2), sr.IndependentSampler(), sr.BoxFilter(), samples=64, seed=k).film
             for k in range(12)]  # fmt: skip
    spread = np.array([film.luminance() for film in films]).std(axis=0, ddof=1)
    ratio = np.sqrt((spread**2).mean() / (films[0].standard_error() ** 2).mean())
    assert ratio == pytest.approx(1, abs=0.1)
    assert relative_error(films[0]) > 0
    assert (films[0].counts() == 64).all()
    assert np.isinf(Film(3, 2).standard_error()).all()


@pytest.mark.parametrize("adaptive", [None, "error"])
def test_samples_that_are_no_numbers_never_reach_the_film(adaptive):
    image = sr.render(wall(20, 20), Broken(), samples=100, sampler=sr.IndependentSampler(), adaptive=adaptive)
    assert (np.asarray(image) == 1).all()
    lost = image.info["invalid_samples"]
    assert lost == pytest.approx(0.2 * 40_000, abs=4 * math.sqrt(0.16 * 40_000))
    assert image.info["sample_count"].sum() + lost == pytest.approx(40_000, rel=0.01)
    assert image.info["standard_error"].max() < 1e-7


def test_adaptive_samples_go_where_neighbours_differ():
    camera = sr.OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), view_height=4, width=64, height=64)
    edge = sr.Rectangle(corner=(-9, -9, 0), edge_u=(9.01, 3, 0), edge_v=(0, 18, 0),
                        material=sr.Lambert(albedo=0, emission=1))  # fmt: skip
    scene = sr.Scene(edge, camera=camera)
    image = sr.render(scene, samples=4, adaptive=0.1, max_samples=64)
    counts = image.info["sample_count"]
    assert set(np.unique(counts)) == {4, 64}
    assert (counts == 64).mean() < 0.1
    exact = np.asarray(sr.render(scene, samples=1024))
    plain = np.asarray(sr.render(scene, samples=4))
    assert np.abs(np.asarray(image) - exact).max() < 0.25
    assert np.abs(np.asarray(image) - exact).sum() < 0.4 * np.abs(plain - exact).sum()


def test_large_pictures_begin_with_a_coarse_one():
    """One sample in 16 of the pixels; meanwhile the others show what their square has."""
    scene = wall(515, 513)
    shown = []

    def keep(progress):
        if progress.stage == "render" and progress.done and not shown:
            shown.append((progress.done, progress.image()))
            raise KeyboardInterrupt

    sr.render(scene, Grain(), samples=2, progress=keep, partial_ok=True)
    ((done, image),) = shown
    assert done <= 129 * 129
    pixels = np.asarray(image)
    seen = pixels[::4, ::4][..., 0] > 0
    assert seen.any()
    for y, x in ((1, 0), (3, 3), (0, 2)):
        cut = pixels[y::4, x::4][..., 0]
        assert (cut == pixels[::4, ::4][: cut.shape[0], : cut.shape[1], 0]).all()
    whole = sr.render(scene, Grain(), samples=1, time=1e-6)
    assert (whole.info["sample_count"] == 1).all()
    film = Film(600, 500)
    for schedule in (Uniform(1), Contrast(1, 9, 0.1), ErrorDriven(1)):
        assert (schedule.next(film, schedule.next(film, None)) == 1).all()


def test_the_code_of_the_page_on_sampling_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[2] / "docs" / "sampling.md").read_text(encoding="utf-8")
    scope: dict[str, object] = {"small": cornell(16)}
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        exec(compile(block.replace('sr.load("cornell")', "small"), "sampling.md", "exec"), scope)
    assert (tmp_path / "so-far.png").exists()
