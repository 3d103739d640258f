"""Structured light: every column decoded, noise by the formula, holes exactly where the projector does not reach."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray.errors import SceneError

AHEAD = sr.Transform.rotate((1, 0, 0), 180)
CLEAN = {"read_noise": 0, "shot_noise": False, "bits": 16}
SMALL = {"columns": 256, "rows": 192, "vfov": 50.0, "samples": 1}
FOCAL = 96 / math.tan(math.radians(25))  # of that projector, in its pixels


def camera(width=96, height=72, focal=110.0):
    return sr.PinholeCamera(fx=focal, cx=width / 2, cy=height / 2, width=width, height=height, pose=AHEAD)


def wall(z: float, material=None):
    return sr.Rectangle(corner=(-9, -9, -z), edge_u=(18, 0, 0), edge_v=(0, 18, 0), name="wall",
                        material=material or sr.Lambert(albedo=0.5))  # fmt: skip


def structured(**options):
    return sr.vision.StructuredLight(**{**SMALL, **options})


@pytest.mark.parametrize(("columns", "period", "shifts"), [(1024, 16, 4), (640, 32, 3), (100, 8, 5), (37, 4, 4)])
def test_every_place_in_every_column_is_decoded(columns, period, shifts):
    """Patterns sampled between columns, as bilinear pixels blend them, in light that differs from place to place."""
    sensor = sr.vision.StructuredLight(
        columns=columns, period=period, shifts=shifts, sensor={**CLEAN, "full_well": 4e4}
    )
    patterns = sensor.patterns()
    assert len(patterns) == 2 * sensor.bits + shifts
    assert patterns.min() >= 0
    assert patterns.max() <= 1
    x = np.linspace(1.0, columns - 1.0, 3001)
    at = np.clip(x - 0.5, 0, columns - 1.000001)
    left, part = at.astype(int), at - at.astype(int)
    seen = patterns[:, left] * (1 - part) + patterns[:, left + 1] * part
    light = (2000 + 1000 * np.sin(x))[None] * seen + 300
    numbers = np.round(65535 * (0.01 + 0.99 * light / 4e4)).astype(np.uint16)
    found = sensor.decode(numbers[:, None])[0]
    assert np.isfinite(found).mean() > 0.999
    assert np.nanmax(np.abs(found - x)) < 0.05 + 0.02 * (period == 4)


def test_a_weak_wave_or_two_weak_bits_are_holes_and_one_weak_bit_is_none():
    """Between stripes one bit of the Gray code is undecided, and the wave decides."""
    device = sr.vision.StructuredLight(
        sensor={"bits": 16, "full_well": 65535, "black": 0}, least_swing=100, columns=128
    )
    sure = np.round(20_000 * device.patterns()[:, [37, 101]]).astype(np.uint16)
    weak_wave, one, two = sure.copy(), sure.copy(), sure.copy()
    weak_wave[2 * device.bits :, 0] = 9000 + 0.004 * sure[2 * device.bits :, 0]  # 40 electrons
    one[:2, 0] = one[:2, 0] // 250 + 9000
    two[:4, 0] = two[:4, 0] // 250 + 9000
    seen = [np.isfinite(device.decode(numbers[:, None])[0]) for numbers in (sure, weak_wave, one, two)]
    assert [s.tolist() for s in seen] == [[True, True], [False, True], [True, True], [False, True]]


def test_without_noise_it_is_the_exact_depth_whatever_the_lens():
    things = wall(2.0), sr.Sphere(center=(0.05, 0.1, -1.4), radius=0.25), sr.PointLight(position=(1, 1, 1), intensity=4)
    lens = sr.CalibratedCamera(fx=110, fy=110, cx=48, cy=36, width=96, height=72, pose=AHEAD, k1=-0.2, k2=0.05)
    for eye in (camera(), lens):
        scene = sr.Scene(*things, camera=eye)
        depth = structured(sensor=CLEAN).capture(scene)
        exact = sr.label(scene, "depth").depth
        seen = depth > 0
        assert seen.mean() > 0.7
        off = np.abs(depth - exact)[seen]
        assert np.median(off) < 0.02 * 2.0**2 / (0.1 * FOCAL)  # two hundredths of a column
        assert np.quantile(off, 0.97) < 0.1 * 2.0**2 / (0.1 * FOCAL)


@pytest.mark.parametrize("shifts", [4, 8])
def test_the_depth_errs_by_the_formula(shifts):
    """sigma_z = z² / (baseline f) sigma_x, sigma_x = period / 2 pi sqrt(2 / N) sqrt(B + r²) / A."""
    z, intensity, noise, period = 1.5, 0.8, 30.0, 16
    narrow = sr.PinholeCamera(fx=5e4, cx=50, cy=50, width=100, height=100, pose=AHEAD)
    sensor = {"read_noise": noise, "exposure": 0.01, "bits": 16, "full_well": 20_000, "black": 0.02}
    device = structured(shifts=shifts, intensity=intensity, sensor=sensor, period=period, least_swing=100)
    depth = device.capture(sr.Scene(wall(z), camera=narrow), seed=2)
    assert (depth > 0).mean() > 0.99
    away = math.hypot(z, 0.1)
    white = 1e4 * 0.5 / math.pi * intensity / away**2 * (z / away)
    column = period / (2 * math.pi) * math.sqrt(2 / shifts) * math.sqrt(white / 2 + noise**2) / (white / 2)
    expected = z**2 / (0.1 * FOCAL) * column
    depth = depth[depth > 0]
    assert abs(depth.std() / expected - 1) < 4 / math.sqrt(2 * depth.size) + 0.01
    assert abs(depth.mean() - z) < 4 * expected / math.sqrt(depth.size) + 0.01 * z**2 / (0.1 * FOCAL)


def test_holes_are_where_the_projector_does_not_reach():
    """Beside a card there is a shadow on the wall; asked of rays from the projector, pixel by pixel."""
    card = sr.Rectangle(corner=(-0.1, -0.2, -1), edge_u=(0.2, 0, 0), edge_v=(0, 0.4, 0), name="card")
    scene = sr.Scene(wall(2.0), card, camera=camera())
    depth = structured(sensor=CLEAN, baseline=0.2).capture(scene)
    labels = sr.label(scene, "position", "instance")
    to = np.array([0.2, 0, 0]) - labels.position
    dark = scene.occluded(labels.position, to * (1 - 1e-9), t_min=1e-6)
    x, y = (FOCAL * -to[..., k] / -labels.position[..., 2] for k in (0, 1))
    dark |= (np.abs(x) > 128) | (np.abs(y) > 96)
    border = np.zeros(dark.shape, bool)  # a pixel is decided by its one sample, anywhere in it
    for axis in (0, 1):
        for step in (-1, 1):
            border |= (np.roll(dark, step, axis) != dark) | (np.roll(labels.instance, step, axis) != labels.instance)
    assert dark[~border].sum() > 200
    assert ((depth > 0) == ~dark)[~border].all()


@pytest.mark.parametrize(("material", "there"), [
    (sr.Lambert(albedo=0.5), True), (sr.Lambert(albedo=0.003), False), (sr.Mirror(), False), (sr.Glass(), False),
])  # fmt: skip
def test_dark_mirroring_and_clear_surfaces_are_holes(material, there):
    scene = sr.Scene(wall(1.5, material), camera=camera())
    if isinstance(material, sr.Glass):
        scene = sr.Scene(sr.Box(lower=(-9, -9, -1.7), upper=(9, 9, -1.5), material=material), camera=camera())
    measured = (structured().capture(scene) > 0).mean()
    assert measured > 0.9 if there else measured < 0.01


def test_grazing_surfaces_and_full_wells_are_holes():
    slant = [sr.Rectangle(corner=(0, -0.5, 0), edge_u=(3, 0, 0), edge_v=(0, 1, 0), name="wall",
                          transform=sr.Transform.translate(-1.5 * c, 0, -2 - 1.5 * s) @ sr.Transform.rotate((0, 1, 0), -a))
             for a in (30, 85) for c, s in [(math.cos(math.radians(a)), -math.sin(math.radians(a)))]]  # fmt: skip
    share = []
    for one in slant:
        scene = sr.Scene(one, camera=camera())
        seen = sr.label(scene, "instance").instance == 0
        share.append((structured(intensity=0.5).capture(scene) > 0)[seen].mean())
    assert share[0] > 0.8
    assert share[1] < 0.5 * share[0]
    near = sr.Scene(wall(0.3), camera=camera())
    assert (structured(intensity=20).capture(near) == 0).all()


def test_light_from_wall_to_wall_is_taken_for_the_projectors():
    """In a bright corner a path tracer's stripes fill up; the wave's contrast goes down and columns are pulled along."""
    walls = [sr.Rectangle(corner=(0, -1, -1.6), edge_u=(side, 0, 1), edge_v=(0, 2, 0), material=sr.Lambert(albedo=0.95))
             for side in (-1, 1)]  # fmt: skip
    scene, device = sr.Scene(*walls, camera=camera(24, 4, 30.0)), structured(sensor=CLEAN, samples=16)
    exact = sr.label(scene, "depth").depth
    off = []
    for integrator in (sr.DirectLighting(), sr.PathTracer(max_depth=4)):
        depth = device.capture(scene.replace(integrator=integrator))
        off.append(np.median(np.abs(depth - exact)[depth > 0]))
    assert off[1] > 2 * off[0]


def test_the_same_seed_gives_the_same_noise():
    scene, sensor = sr.Scene(wall(2.0), camera=camera(16, 12)), structured()
    first = sensor.capture(scene, seed=1, frame=4, threads=1)
    assert (first == sensor.capture(scene, seed=1, frame=4, threads=2)).all()
    assert (first != sensor.capture(scene, seed=1, frame=5)).any()


@pytest.mark.parametrize(("wrong", "said"), [
    ({"period": 5}, "StructuredLight.period: got 5; allowed: an even number"),
    ({"sensor": {"bayer": "RGGB"}}, "without filters"), ({"shifts": 2}, "StructuredLight.shifts"),
    ({"baseline": 0}, "StructuredLight.baseline"), ({"colums": 9}, "did you mean 'columns'"),
])  # fmt: skip
def test_bad_settings_are_told(wrong, said):
    with pytest.raises(SceneError, match=said):
        sr.vision.StructuredLight(**wrong)


def test_scenes_without_a_camera_are_told():
    with pytest.raises(SceneError, match="StructuredLight: got a scene without a camera"):
        sr.vision.StructuredLight().capture(sr.Scene(sr.Sphere()))
