"""Trajectories against closed forms and SciPy; rigs and animations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

import sightray as sr
from sightray.errors import SceneError
from sightray.vision.animation import Animation
from sightray.vision.rigs import Rig, posed, stereo_rig
from sightray.vision.rotations import between, exp, log, matrix, quaternion, slerp
from sightray.vision.trajectory import Around, Keyframes, Orbit, Still


def scipy_quaternion(rotation: Rotation) -> np.ndarray:
    x, y, z, w = rotation.as_quat()
    return np.array([w, x, y, z]) * (1 if w >= 0 else -1)


def random_poses(n: int, seed: int) -> np.ndarray:
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = Rotation.random(n, random_state=seed).as_matrix()
    poses[:, :3, 3] = np.random.default_rng(seed).normal(size=(n, 3))
    return poses


def test_quaternions_agree_with_scipy():
    half_turns = [Rotation.from_rotvec(np.pi * np.array(a)) for a in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.8, 0))]
    for r in [*Rotation.random(200, random_state=1), *half_turns, Rotation.identity()]:
        q = quaternion(r.as_matrix())
        truth = scipy_quaternion(r)
        assert q[0] >= 0
        assert min(np.abs(q - truth).max(), np.abs(q + truth).max()) < 1e-14
        np.testing.assert_allclose(matrix(q), r.as_matrix(), atol=1e-14)
    for r in Rotation.random(50, random_state=2):
        np.testing.assert_allclose(log(quaternion(r.as_matrix())), r.as_rotvec(), atol=1e-13)
    np.testing.assert_allclose(log(exp(np.array([1e-11, 0, 0]))), [1e-11, 0, 0], rtol=1e-6)


def test_linear_keyframes_are_slerp_and_straight_lines():
    poses, times = random_poses(5, 3), np.array([0.0, 0.7, 1.0, 2.5, 3.0])
    path, theirs = Keyframes(times, poses, "linear"), Slerp(times, Rotation.from_matrix(poses[:, :3, :3]))
    for t in np.linspace(0, 3, 31):
        np.testing.assert_allclose(path.pose(t)[:3, :3], theirs(t).as_matrix(), atol=1e-13)
        straight = [np.interp(t, times, poses[:, k, 3]) for k in range(3)]
        np.testing.assert_allclose(path.pose(t)[:3, 3], straight, atol=1e-13)


def test_cubic_keyframes_pass_through_the_poses_without_a_jerk():
    poses, times = random_poses(6, 4), np.array([0.0, 0.5, 1.0, 2.2, 3.0, 3.5])
    path = Keyframes(times, poses)
    for t, pose in zip(times, poses, strict=True):
        np.testing.assert_allclose(path.pose(t), pose, atol=1e-12)
    h = 1e-5
    for t in times[1:-1]:
        before, after = (path.pose(t) - path.pose(t - h)) / h, (path.pose(t + h) - path.pose(t)) / h
        assert np.abs(before - after).max() < 2e-3  # second derivatives times h
    with_corners = Keyframes(times, poses, "linear")
    t = times[2]
    before = (with_corners.pose(t) - with_corners.pose(t - h)) / h
    assert np.abs(before - (with_corners.pose(t + h) - with_corners.pose(t)) / h).max() > 0.1


def test_cubic_keyframes_of_even_times_are_catmull_rom():
    p = np.random.default_rng(5).normal(size=(4, 3))
    poses = [sr.Transform.translate(*row) for row in p]
    path = Keyframes([0, 1, 2, 3], poses)
    for s in (0.25, 0.5, 0.9):
        basis = 0.5 * np.array([-s + 2 * s**2 - s**3, 2 - 5 * s**2 + 3 * s**3, s + 4 * s**2 - 3 * s**3, -(s**2) + s**3])
        np.testing.assert_allclose(path.pose(1 + s)[:3, 3], basis @ p, atol=1e-13)


def test_an_even_turn_stays_even():
    """A uniform rotation at a uniform speed is in the span of both splines."""
    poses = [sr.Transform.translate(t, 0, 2 * t) @ sr.Transform.rotate((1, 2, 3), 40 * t) for t in range(5)]
    for kind in ("linear", "cubic"):
        path = Keyframes(range(5), poses, kind)
        for t in (0.3, 1.5, 2.75, 3.9):
            truth = (sr.Transform.translate(t, 0, 2 * t) @ sr.Transform.rotate((1, 2, 3), 40 * t)).matrix
            np.testing.assert_allclose(path.pose(t), truth, atol=1e-12)


def test_keyframes_rest_before_and_after():
    path = Keyframes([1, 2], random_poses(2, 6))
    np.testing.assert_array_equal(path.pose(0), path.pose(1))
    np.testing.assert_array_equal(path.pose(9), path.pose(2))


def test_orbit_looks_at_its_center_and_moves_at_its_speed():
    orbit = Orbit((1, 2, 3), 4.0, elevation=30, azimuth=10, speed=50)
    for t in (0.0, 0.4, 2.0):
        pose = orbit.pose(t)
        np.testing.assert_allclose(np.linalg.norm(pose[:3, 3] - (1, 2, 3)), 4.0, rtol=1e-14)
        np.testing.assert_allclose(pose[:3, 3] + 4 * pose[:3, 2], (1, 2, 3), atol=1e-13)
        speed = np.linalg.norm(orbit.velocity(t))
        np.testing.assert_allclose(speed, np.radians(50) * 4 * np.cos(np.radians(30)), rtol=1e-6)
    np.testing.assert_allclose(Orbit(radius=2, elevation=0, azimuth=90).pose(0)[:3, 3], (2, 0, 0), atol=1e-14)


def test_hand_held_jitter_has_its_size_and_its_band():
    """Root mean square over ten minutes, and no power outside the band."""
    low, high, rate, n = 0.5, 5.0, 40.0, 24_000
    shaken = Still(np.eye(4)).shaken(11, position=0.01, degrees=0.5, low=low, high=high)
    times = np.arange(n) / rate
    poses = np.array([shaken.pose(t) for t in times])
    np.testing.assert_allclose(poses[:, :3, 3].std(axis=0), 0.01, rtol=0.05)
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_rotvec(degrees=True)
    np.testing.assert_allclose(turns.std(axis=0), 0.5, rtol=0.05)
    power = np.abs(np.fft.rfft(poses[:, 0, 3] * np.hanning(n))) ** 2
    f = np.fft.rfftfreq(n, 1 / rate)
    outside = power[(f < 0.9 * low) | (f > 1.1 * high)].sum()
    assert outside < 1e-6 * power.sum()
    again = Still(np.eye(4)).shaken(11, position=0.01, degrees=0.5, low=low, high=high)
    assert (again.pose(3.3) == shaken.pose(3.3)).all()
    assert (Still(np.eye(4)).shaken(12).pose(3.3) != shaken.pose(3.3)).any()


def test_around_turns_about_its_point():
    spin = Keyframes([0, 1], [np.eye(4), sr.Transform.rotate((0, 1, 0), 90)], "linear")
    pose = Around(spin, (3, 0, 1)).pose(0.5)
    np.testing.assert_allclose(pose @ [3, 7, 1, 1], [3, 7, 1, 1], atol=1e-14)


@pytest.mark.parametrize("camera", [
    sr.PerspectiveCamera(roll=20), sr.ThinLensCamera(f_number=2.0), sr.FisheyeCamera(), sr.OrthographicCamera(),
    sr.PinholeCamera(fx=100), sr.CalibratedCamera(fx=100, k1=0.1), sr.PanoramaCamera(),
], ids=lambda c: type(c).__name__)  # fmt: skip
def test_posed_cameras_stand_where_they_should(camera):
    pose = random_poses(1, 8)[0]
    there = posed(camera, pose)
    np.testing.assert_allclose(there.world_from_camera(), pose, atol=1e-14)
    pixels = np.array([[100.5, 200.0], [320.0, 240.0]])
    moved = pose @ np.linalg.inv(camera.world_from_camera())
    (origins, directions), (before, along) = there.rays(pixels), camera.rays(pixels)
    np.testing.assert_allclose(origins, before @ moved[:3, :3].T + moved[:3, 3], atol=1e-12)
    np.testing.assert_allclose(directions, along @ moved[:3, :3].T, atol=1e-12)


def test_stereo_rig_is_rectified_and_keeps_its_baseline():
    rig = stereo_rig(sr.PerspectiveCamera(eye=(1, 2, 3), width=64, height=48), baseline=0.2)
    assert rig.rectified
    left, right = rig.at(Orbit(speed=77).pose(0.6)).values()
    relative = np.linalg.inv(left.world_from_camera()) @ right.world_from_camera()
    truth = np.eye(4)
    truth[0, 3] = 0.2
    np.testing.assert_allclose(relative, truth, atol=1e-14)
    turned = Rig({"a": left, "b": posed(right, right.world_from_camera() @ sr.Transform.rotate((0, 1, 0), 5).matrix)})
    assert not turned.rectified
    with pytest.raises(SceneError, match="baseline"):
        stereo_rig(left, 0.0)


def test_animation_moves_what_it_names_and_shares_the_rest():
    ball = sr.Sphere(center=(1, 0, 0), radius=0.5, name="ball")
    scene = sr.Scene(
        ball, sr.Plane(point=(0, 0, 0), normal=(0, 1, 0)), camera=sr.PerspectiveCamera(width=32, height=32)
    )
    spin = Keyframes([0, 1], [np.eye(4), sr.Transform.rotate((0, 1, 0), 90)], "linear")
    there = Animation(scene, objects={"ball": spin}).at(1.0)
    hit = there.intersect((0, 0.1, -5), (0, 0, 1))  # the ball has gone from +x to -z
    np.testing.assert_allclose(hit.t, 5 - 1 - np.sqrt(0.25 - 0.01), rtol=1e-12)
    assert there.objects[1] is scene.objects[1]
    assert there.objects[0].of is ball
    with pytest.raises(SceneError, match="unknown object 'bell'; did you mean 'ball'"):
        Animation(scene, objects={"bell": spin})


def test_bad_keyframes_are_told():
    for times, poses, said in (([0, 0], [np.eye(4)] * 2, "increasing"), ([0], [], "one for each"),
                               ([0], [np.diag([2.0, 1, 1, 1])], "not rigid")):  # fmt: skip
        with pytest.raises(SceneError, match=said):
            Keyframes(times, poses)


def test_slerp_goes_the_shorter_way():
    a, b = exp(np.array([0, 0, 3.0])), exp(np.array([0, 0, -3.0]))
    np.testing.assert_allclose(np.linalg.norm(between(a, b)), 2 * np.pi - 6, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(log(slerp(a, b, 0.5))), np.pi, rtol=1e-12)
