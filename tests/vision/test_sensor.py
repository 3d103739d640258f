"""The sensor against the photon transfer that EMVA 1288 states, and against its own formula without noise."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray.errors import SceneError
from sightray.vision.sensor import PATTERNS

EVEN = {"read_noise": 0.0, "shot_noise": False}


def grey(value: float, height: int = 200, width: int = 200) -> np.ndarray:
    return np.full((height, width, 3), value)


@pytest.mark.parametrize("electrons", [50, 1000, 6000])
@pytest.mark.parametrize("read_noise", [0.0, 8.0])
def test_photon_transfer(electrons, read_noise):
    """Mean and variance of the numbers: K times the electrons, and K² (electrons + read noise²) + 1/12, K numbers each."""
    sensor = sr.vision.Sensor(
        exposure=0.5, sensitivity=2.0, full_well=10_000, read_noise=read_noise, bits=16, black=0.01
    )
    numbers = sensor.capture(grey(electrons), seed=5).astype(float).ravel()
    gain = 65535 * 0.99 / 10_000
    mean, variance = 655.35 + gain * electrons, gain**2 * (electrons + read_noise**2) + 1 / 12
    assert abs(numbers.mean() - mean) < 4 * np.sqrt(variance / numbers.size)
    assert abs(numbers.var() - variance) < 4 * variance * np.sqrt((2 + 1 / electrons) / numbers.size)


def test_dark_current_and_full_wells():
    dark = sr.vision.Sensor(exposure=2.0, dark_current=500.0, full_well=4000, bits=12, **EVEN)
    assert (dark.capture(grey(0.0, 4, 4)) == 1024).all()  # 1000 of 4000 electrons, 4095 numbers
    bright = sr.vision.Sensor(full_well=4000, read_noise=5.0, bits=12).capture(grey(1e9, 40, 40))
    assert bright.max() == 4095
    assert 0.3 < (bright < 4095).mean() < 0.7  # wells fill up before noise is added, which then falls to either side
    assert (bright > 4095 * (1 - 6 * 5 / 4000)).all()


@pytest.mark.parametrize("pattern", PATTERNS)
def test_each_pixel_sees_through_its_filter(pattern):
    colors = np.broadcast_to([0.1, 0.2, 0.4], (5, 7, 3))
    raw = sr.vision.Sensor(exposure=1, sensitivity=1000, full_well=1000, bits=10, bayer=pattern, **EVEN).capture(colors)
    names = {102: "R", 205: "G", 409: "B"}
    assert raw.shape == (5, 7)
    assert "".join(names[raw[y, x]] for y in (0, 1) for x in (0, 1)) == pattern
    assert (raw[2:] == raw[:-2]).all()
    assert (raw[:, 2:] == raw[:, :-2]).all()


def test_vignetting_darkens_towards_the_corners():
    sensor = sr.vision.Sensor(exposure=1, sensitivity=1, full_well=1, bits=16, vignetting=(-0.3, -0.1), **EVEN)
    seen = sensor.capture(grey(1.0, 101, 301))[..., 0] / 65535
    assert seen[50, 150] == pytest.approx(1.0, abs=1e-5)
    r2 = ((300.5 - 150.5) ** 2 + 0) / (150.5**2 + 50.5**2)
    assert seen[50, 300] == pytest.approx(1 - 0.3 * r2 - 0.1 * r2**2, abs=2e-5)
    assert (sr.vision.Sensor(vignetting=(-9,)).falloff(20, 20) >= 0).all()


def test_response_and_bits():
    ramp = np.repeat(np.linspace(0, 1, 33)[None, :, None], 3, axis=2)
    options = {"exposure": 1, "sensitivity": 1, "full_well": 1, **EVEN}
    encoded = sr.vision.Sensor(bits=8, response="srgb", **options).capture(ramp)
    assert encoded.dtype == np.uint8
    np.testing.assert_array_equal(encoded, sr.Image(ramp.astype(np.float32)).to_bytes())
    root = sr.vision.Sensor(bits=16, response=2.0, **options).capture(ramp)
    assert root.dtype == np.uint16
    np.testing.assert_allclose(root / 65535, np.sqrt(ramp), atol=1e-5)
    assert set(np.unique(sr.vision.Sensor(bits=1, **options).capture(ramp))) == {0, 1}


def test_noise_is_that_of_its_seed_and_frame():
    sensor, light = sr.vision.Sensor(), grey(0.3, 30, 30)
    first = sensor.capture(light, seed=1, frame=2)
    assert (first == sensor.capture(light, seed=1, frame=2)).all()
    for other in (sensor.capture(light, seed=1, frame=3), sensor.capture(light, seed=2, frame=2)):
        assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 4 / np.sqrt(first.size)


def test_pictures_are_taken_as_they_come():
    scene = sr.Scene(sr.Sphere(), sr.PointLight(position=(0, 3, 3), intensity=20),
                     camera=sr.PerspectiveCamera(eye=(0, 0, 4), target=(0, 0, 0), width=16, height=12))  # fmt: skip
    image = sr.render(scene, samples=1)
    sensor = sr.vision.Sensor(full_well=20_000, bits=16, **EVEN)
    np.testing.assert_allclose(sensor.capture(image) / 65535, np.clip(np.asarray(image) / 2, 0, 1), atol=1e-5)


@pytest.mark.parametrize(("wrong", "said"), [
    ({"exposure": 0}, "Sensor.exposure: got 0; allowed: a finite number > 0"),
    ({"read_noise": -1}, "Sensor.read_noise"), ({"bits": 17}, "Sensor.bits"), ({"bits": True}, "Sensor.bits"),
    ({"bits": float("nan")}, "Sensor.bits"),
    ({"bayer": "RGBG"}, "RGGB"), ({"response": "sRGB"}, "srgb"), ({"response": 0.0}, "Sensor.response"),
    ({"black": 1.0}, "Sensor.black"), ({"vignetting": 0.2}, "Sensor.vignetting"),
])  # fmt: skip
def test_bad_settings_are_told(wrong, said):
    with pytest.raises(SceneError, match=said.replace("(", r"\(")):
        sr.vision.Sensor(**wrong)


@pytest.mark.parametrize("wrong", [{"seed": -1}, {"frame": 0.5}])
def test_bad_seeds_are_told(wrong):
    with pytest.raises(SceneError, match=r"Sensor: (seed|frame): got"):
        sr.vision.Sensor().capture(grey(0.1, 2, 2), **wrong)


@pytest.mark.parametrize("light", [np.zeros((4, 4)), np.full((2, 2, 3), np.nan)])
def test_bad_radiance_is_told(light):
    with pytest.raises(SceneError, match="Sensor: got radiance"):
        sr.vision.Sensor().capture(light)
