"""Depth sensors that triangulate: their noise, steps, range and holes against the formulas that make them."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray.errors import SceneError

F, B = 200.0, 0.1


def seen(*things, width=120, height=90):
    camera = sr.PinholeCamera(fx=F, cx=width / 2, cy=height / 2, width=width, height=height,
                              pose=sr.Transform.rotate((1, 0, 0), 180))  # fmt: skip
    return sr.Scene(*things, camera=camera)


def wall(z: float):
    return sr.Rectangle(corner=(-9, -9, -z), edge_u=(18, 0, 0), edge_v=(0, 18, 0), name="wall")


def test_without_noise_it_is_the_exact_depth():
    scene = seen(wall(4.0), sr.Sphere(center=(0, 0, -2.5), radius=0.5))
    depth, exact = sr.vision.StereoDepth(baseline=B, noise=0, step=0).capture(scene), sr.label(scene, "depth").depth
    measured = depth > 0
    assert measured.mean() > 0.7
    np.testing.assert_allclose(depth[measured], exact[measured], rtol=1e-12)


@pytest.mark.parametrize("z", [1.0, 2.0, 4.0])
def test_the_error_grows_with_the_square_of_the_depth(z):
    depth = sr.vision.StereoDepth(baseline=B, noise=0.05, step=0).capture(seen(wall(z)), seed=3)
    depth = depth[depth > 0]
    expected = z**2 / (F * B) * 0.05
    assert abs(depth.std() / expected - 1) < 4 / np.sqrt(2 * depth.size) + 0.01
    assert abs(depth.mean() - z) < 4 * expected / np.sqrt(depth.size) + 2 * expected**2 / z  # 1/d has a small bias


def test_depths_come_in_steps_of_disparity():
    slope = sr.Rectangle(corner=(-9, -1, -2), edge_u=(18, 0, 0), edge_v=(0, 2, -2))
    depth = sr.vision.StereoDepth(baseline=B, noise=0, step=0.25).capture(seen(slope))
    steps = F * B / depth[depth > 0] / 0.25
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert len(np.unique(np.round(steps))) > 3


def test_holes_are_where_the_other_eye_does_not_see():
    """Beside a near card, the wall's hidden strip is as wide as the difference of both disparities."""
    card = sr.Rectangle(corner=(-0.1, -9, -1), edge_u=(0.2, 0, 0), edge_v=(0, 18, 0), name="card")
    depth = sr.vision.StereoDepth(baseline=B, noise=0, step=0, most=500).capture(seen(wall(4.0), card))
    row = depth[45]
    left = 60 - 0.1 * F  # of the card in the picture
    hidden = F * B / 1.0 - F * B / 4.0
    assert (row[int(left - hidden) + 1 : int(left)] == 0).all()
    assert row[int(left - hidden) - 2] == pytest.approx(4.0)
    assert row[60] == pytest.approx(1.0)
    assert row[int(60 + 0.1 * F) + 1] == pytest.approx(4.0)
    assert (row[: int(F * B / 4.0)] == 0).all()  # out of the other picture


def test_what_is_too_near_or_too_far_is_not_measured():
    sensor = sr.vision.StereoDepth(baseline=B, noise=0, step=0, least=4, most=10)  # 5 to 2 metres
    for z, there in ((1.9, False), (2.1, True), (4.9, True), (5.1, False)):
        assert (sensor.capture(seen(wall(z)))[45, 100] > 0) == there


def test_the_same_seed_gives_the_same_noise():
    scene, sensor = seen(wall(3.0)), sr.vision.StereoDepth(baseline=B)
    first = sensor.capture(scene, seed=1, frame=4)
    assert (first == sensor.capture(scene, seed=1, frame=4)).all()
    assert (first != sensor.capture(scene, seed=1, frame=5)).any()


@pytest.mark.parametrize(("wrong", "said"), [
    ({"baseline": 0}, "StereoDepth.baseline: got 0; allowed: a finite number > 0"), ({"noise": -1}, "StereoDepth.noise"),
    ({"step": float("nan")}, "StereoDepth.step"), ({"least": 9, "most": 8}, "StereoDepth.most"),
])  # fmt: skip
def test_bad_settings_are_told(wrong, said):
    with pytest.raises(SceneError, match=said):
        sr.vision.StereoDepth(**wrong)


def test_cameras_that_are_no_pinholes_are_told():
    with pytest.raises(SceneError, match="pinhole"):
        sr.vision.StereoDepth().capture(sr.Scene(sr.Sphere(), camera=sr.FisheyeCamera(eye=(0, 0, 4), target=(0, 0, 0))))
