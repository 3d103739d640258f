"""Time of flight: exact without noise, its noise by the formula, mixtures as sums of phasors, corners that are rounded."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray.errors import SceneError
from sightray.vision.depth_sensors.time_of_flight import unwrapped

LIGHT = 299_792_458.0
AHEAD = sr.Transform.rotate((1, 0, 0), 180)
QUIET = {"read_noise": 0, "shot_noise": False, "bits": 16, "full_well": 20_000}
EVEN = {"sensor": QUIET, "passband": 0, "least_amplitude": 0, "max_depth": 1, "samples": 4}


def camera(width=32, height=24, focal=200.0):
    return sr.PinholeCamera(fx=focal, cx=width / 2, cy=height / 2, width=width, height=height, pose=AHEAD)


def wall(z: float, albedo=0.5, x=-40.0):
    return sr.Rectangle(corner=(x, -40, -z), edge_u=(80, 0, 0), edge_v=(0, 80, 0), material=sr.Lambert(albedo=albedo))


def tof(**options):
    return sr.vision.TimeOfFlight(**{**EVEN, **options})


@pytest.mark.parametrize("lamp", [(0, 0, 0), (0.2, -0.1, 0.05)])
@pytest.mark.parametrize("kind", [
    camera(focal=100.0), sr.FisheyeCamera(eye=(0, 0, 0), target=(0, 0, -1), fov=30, width=24, height=24),
])  # fmt: skip
def test_without_noise_it_is_the_exact_depth(kind, lamp):
    """Up to the mean over a pixel and the rounding of 16 bits."""
    scene = sr.Scene(wall(3.0), sr.Sphere(center=(0.1, 0, -2), radius=0.1), camera=kind)
    flight = tof(lamp=lamp, intensity=8).measure(scene)
    exact = sr.label(scene, "depth", "distance", "instance")
    inside = np.ones(exact.depth.shape, bool)  # away from edges
    for axis in (0, 1):
        for step in (-1, 1):
            inside &= np.roll(exact.instance, step, axis) == exact.instance
    inside &= (flight.depth > 0) & (exact.instance == 0)
    assert inside.mean() > 0.3
    assert np.median(np.abs(flight.depth - exact.depth)[inside]) < 1e-3
    off = flight.distance / exact.distance - 1
    assert np.abs(np.median(off[inside])) < 1e-3


@pytest.mark.parametrize("phases", [3, 4, 8])
@pytest.mark.parametrize("passband", [0.0, 0.3])
def test_the_phase_errs_by_the_formula(phases, passband):
    """sigma_p = sqrt(2 / N) sqrt(B + r²) / A (Lange and Seitz for N = 4); sigma_z = c / (4 pi f) sigma_p."""
    z, frequency, noise, well, intensity, rho, contrast, sun = 3.0, 40e6, 12.0, 50_000, 9.0, 0.5, 0.7, 2.0
    narrow = camera(100, 100, 20_000.0)  # all pixels see the same
    scene = sr.Scene(wall(z, rho), sr.DirectionalLight(direction=(0, 0, -1), irradiance=sun), camera=narrow)
    sensor = {"read_noise": noise, "full_well": well, "bits": 16, "exposure": 0.01, "sensitivity": 1e6, "black": 0.01}
    flight = sr.vision.TimeOfFlight(
        frequencies=frequency, phases=phases, sensor=sensor, intensity=intensity, contrast=contrast, passband=passband,
        least_amplitude=0, max_depth=1, samples=2,
    ).measure(scene, seed=5)  # fmt: skip
    back = 1e4 * rho / math.pi * intensity / z**2
    steady = 1e4 * passband * rho / math.pi * sun
    amplitude, rounding = contrast * back, (well / 65535) ** 2 / 12
    third = 0.5 * amplitude * math.cos(3 * 4 * math.pi * frequency * z / LIGHT) if phases == 3 else 0.0
    phase = math.sqrt(2 / phases) * math.sqrt(back + steady - third + noise**2 + rounding) / amplitude
    expected = LIGHT / (4 * math.pi * frequency) * phase
    n = flight.depth.size
    assert abs(flight.depth.std() / expected - 1) < 4 / math.sqrt(2 * n) + phase**2
    true = (2 * z % (LIGHT / frequency)) / 2
    assert abs(flight.depth.mean() - true) < 4 * expected / math.sqrt(n)
    assert abs(flight.amplitude.mean() - amplitude) < 4 * phase * amplitude / math.sqrt(n) + phase**2 * amplitude


def test_one_frequency_wraps_and_several_tell():
    scene = sr.Scene(wall(10.0, 0.9), camera=camera())
    turn = LIGHT / 2 / 20e6
    once = tof(frequencies=[20e6], intensity=40).capture(scene)
    np.testing.assert_allclose(np.median(once), 10.0 - turn, atol=0.02)
    twice = tof(frequencies=[40e6, 50e6], intensity=40)
    assert twice.range == pytest.approx(LIGHT / 2 / 10e6)
    np.testing.assert_allclose(np.median(twice.capture(scene)), 10.0, atol=0.02)
    folded = tof(frequencies=[40e6, 50e6], intensity=40, unwrap=False).capture(scene)
    assert np.median(folded) < LIGHT / 2 / 50e6


def test_unwrapping_finds_every_length_up_to_the_range():
    frequencies = (16e6, 80e6, 120e6)
    ways = np.linspace(0.05, LIGHT / 8e6 - 0.05, 997)[None]
    phase = np.array([2 * math.pi * f / LIGHT * ways % (2 * math.pi) for f in frequencies])
    phase += np.random.default_rng(0).normal(0, 0.05, phase.shape)
    found = unwrapped(phase, np.ones(phase.shape), frequencies, LIGHT / 8e6, True)
    sigma = 0.05 * LIGHT / (2 * math.pi) / math.sqrt(sum(f**2 for f in frequencies))  # of the weighed mean
    assert abs((found - ways).std() / sigma - 1) < 4 / math.sqrt(2 * ways.size)


def test_a_pixel_that_sees_two_walls_adds_their_phasors():
    """A card covers a quarter of a pixel: depths between the two, where nothing is."""
    near, far, share, frequency = 1.0, 2.6, 0.25, 30e6
    pixel = camera(1, 1, 50.0)
    card = sr.Rectangle(corner=(-9 * near, -9, -near), edge_u=(9 * near + (share - 0.5) * near / 50.0, 0, 0),
                        edge_v=(0, 18, 0), material=sr.Lambert(albedo=0.2))  # fmt: skip
    flight = tof(frequencies=frequency, samples=4096, sensor={**QUIET, "full_well": 5000}).measure(
        sr.Scene(wall(far, 0.8), card, camera=pixel))  # fmt: skip
    k = 4 * math.pi * frequency / LIGHT
    both = share * 0.2 / near**2 * np.exp(1j * k * near) + (1 - share) * 0.8 / far**2 * np.exp(1j * k * far)
    assert flight.distance[0, 0] == pytest.approx(np.angle(both) / k, abs=2e-3)
    assert near + 0.3 < flight.distance[0, 0] < far - 0.3


def test_corners_are_rounded_by_light_that_came_a_second_way():
    """Two bright walls at a right angle: with one surface exact, with several farther, most of all near the fold."""
    walls = [sr.Rectangle(corner=(0, -2, -3), edge_u=(side * 3, 0, 3), edge_v=(0, 4, 0), material=sr.Lambert(albedo=0.9))
             for side in (-1, 1)]  # fmt: skip
    scene = sr.Scene(*walls, camera=camera(40, 4, 20.0))
    exact = sr.label(scene, "depth").depth
    off = {n: tof(max_depth=n, samples=256, intensity=9, frequencies=20e6).capture(scene) - exact for n in (1, 2, 6)}
    assert np.abs(off[1]).max() < 0.03
    assert (off[2] > off[1] + 0.03).mean() > 0.8
    assert (off[6] > off[2]).mean() > 0.9
    assert off[6][:, 10:30].mean() > 2 * off[6][:, [0, 1, 38, 39]].mean()


def test_what_is_dark_or_too_bright_is_not_measured():
    scene = sr.Scene(wall(3.0, 0.02), sr.Sphere(center=(0, 0, -0.6), radius=0.1), camera=camera())
    exact = sr.label(scene, "instance").instance
    depth = tof(least_amplitude=40, intensity=5, sensor={"full_well": 20_000}).capture(scene)
    assert (depth[exact == 0] == 0).all()  # about 28 electrons
    assert (depth[exact == 1] == 0).sum() > 20  # full wells
    depth = tof(least_amplitude=10, intensity=5, sensor={"full_well": 1_000_000}).capture(scene)
    assert (depth > 0).mean() > 0.95
    empty = sr.Scene(sr.Sphere(center=(0, 0, 9)), camera=camera())
    assert (tof().capture(empty) == 0).all()


def test_lamps_of_the_scene_are_bodies_but_no_clocks():
    lamp = sr.RectangleLight(corner=(1, -1, -2), edge_u=(-2, 0, 0), edge_v=(0, 2, 0), radiance=3)
    scene = sr.Scene(wall(4.0), lamp, camera=camera())
    lit = sr.vision.TimeOfFlight().lit(scene)
    np.testing.assert_array_equal(sr.label(lit, "depth").depth, sr.label(scene, "depth").depth)
    assert [type(light).__name__ for light in lit.lights] == ["PointLight"]


def test_noise_is_that_of_its_seed_and_frame_for_any_threads():
    scene, sensor = sr.Scene(wall(2.0), camera=camera()), sr.vision.TimeOfFlight(samples=2)
    first = sensor.capture(scene, seed=1, frame=4, threads=1)
    assert (first == sensor.capture(scene, seed=1, frame=4, threads=2)).all()
    assert (first != sensor.capture(scene, seed=1, frame=5)).any()


@pytest.mark.parametrize(("wrong", "said"), [
    ({"frequencies": []}, r"TimeOfFlight.frequencies: got \[\]"), ({"frequencies": [20e6, -1]}, "1 to 1e12"),
    ({"frequencies": [80e6, 80_000_001]}, "turns of the finest swing"), ({"phases": 2}, "TimeOfFlight.phases"),
    ({"sensor": {"response": "srgb"}}, "linear response"), ({"sensor": {"bits": 40}}, "Sensor.bits"),
    ({"sensor": 3}, "allowed: a Sensor"), ({"contrast": 1.5}, "TimeOfFlight.contrast"),
    ({"frequency": 3}, "did you mean 'frequencies'"),
])  # fmt: skip
def test_bad_settings_are_told(wrong, said):
    with pytest.raises(SceneError, match=said):
        sr.vision.TimeOfFlight(**wrong)


def test_scenes_without_a_camera_are_told():
    with pytest.raises(SceneError, match="TimeOfFlight: got a scene without a camera"):
        sr.vision.TimeOfFlight().capture(sr.Scene(sr.Sphere()))
