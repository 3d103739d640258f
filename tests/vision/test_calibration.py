"""Real libraries recover, from rendered pictures and from labels, the camera that made them."""

from __future__ import annotations

import numpy as np
import pytest
from boards import charuco, charuco_corners, grey_picture, opencv_matrix, rms
from label_scenes import scene

import sightray as sr
from sightray.cameras.base import look_at

pytestmark = pytest.mark.peers

LENS = {"fx": 700.0, "fy": 704.0, "cx": 325.3, "cy": 236.4, "k1": -0.22, "k2": 0.06, "p1": 1.2e-3, "p2": -8e-4}
FOCAL, LEFT = 5e-4, 0.1  # relative; pixels RMS over the picture


def board_views(count: int = 18) -> list[sr.CalibratedCamera]:
    """Views of the board from all sides at 0.75 to 1.0 m, leaning by 12 to 40 degrees, turned all round."""
    found = []
    for k in range(count):
        around, lean = 2.4 * k, np.radians(12 + 28 * ((0.618 * k) % 1))
        eye = (0.75 + 0.25 * ((0.38 * k) % 1)) * np.array(
            [np.sin(lean) * np.cos(around), np.sin(lean) * np.sin(around), np.cos(lean)]
        )
        target, roll = (0.12 * np.cos(1.7 * k), 0.08 * np.sin(1.7 * k), 0), 2.0 * k
        pose = look_at(eye, target, (np.sin(roll), np.cos(roll), 0), "test")
        found.append(sr.CalibratedCamera(width=640, height=480, **LENS, pose=pose))
    return found


def test_charuco_calibration_recovers_focal_length_and_distortion():
    """Focal lengths within 0.05 %; the lens puts directions where ours does, within 0.1 pixels RMS.

    What is off is what corners 0.07 pixels off allow: of their true places the same views leave nothing.
    """
    import cv2

    board, page, corners = charuco()
    cameras = board_views()
    objects, seen, exact = [], [], []
    for camera in cameras:
        found, ids = charuco_corners(board, grey_picture(page, camera, 16))
        assert len(found) >= 10
        objects.append(corners[ids].astype(np.float32))
        seen.append(found.astype(np.float32)[:, None])
        exact.append((camera.project(corners[ids]) - 0.5).astype(np.float32)[:, None])
    camera = cameras[0]
    true, numbers = opencv_matrix(camera), np.array([camera.k1, camera.k2, camera.p1, camera.p2, 0.0])
    size, flags = (640, 480), cv2.CALIB_FIX_K3
    _, k, lens, *_ = cv2.calibrateCamera(objects, exact, size, None, None, flags=flags)
    np.testing.assert_allclose(k, true, atol=1e-3)
    np.testing.assert_allclose(lens.ravel(), numbers, atol=1e-5)

    error, k, lens, _, _, spread, _, _ = cv2.calibrateCameraExtended(objects, seen, size, None, None, flags=flags)
    assert error <= 0.1
    assert np.abs(k[[0, 1], [0, 1]] / true[[0, 1], [0, 1]] - 1).max() <= FOCAL
    assert (np.abs(k[:2, 2] - true[:2, 2]) <= 3 * spread[2:4, 0]).all()

    grid = np.meshgrid(np.linspace(-0.42, 0.42, 15), np.linspace(-0.31, 0.31, 11))
    directions = np.stack([*grid, np.ones((11, 15))], -1).reshape(-1, 3)
    ours = cv2.projectPoints(directions, np.zeros(3), np.zeros(3), true, numbers)[0][:, 0]
    turn = np.zeros(
        3
    )  # a principal point that is off by a part of a pixel is a turn of the camera, in all of its views
    for _ in range(4):
        theirs, slopes = cv2.projectPoints(directions, turn, np.zeros(3), k, lens)
        left = theirs[:, 0] - ours
        turn = turn - np.linalg.lstsq(slopes[:, :3], left.ravel(), rcond=None)[0]
    assert rms(left) <= LEFT
    assert np.abs(left).max() <= 5 * LEFT


def test_fundamental_and_essential_matrix_of_true_correspondences():
    """By OpenCV's own Sampson distance our F leaves 1e-9 of a pixel; by its eight-point method, normal equations
    of half the digits, it finds ours again."""
    import cv2

    first = sr.PinholeCamera(
        width=160, height=120, fx=150.0, pose=look_at((0.4, 1.6, 5.0), (0.1, 0.3, 0), (0, 1, 0), "t")
    )
    second = first.replace(pose=look_at((1.3, 1.2, 4.4), (0.0, 0.35, 0.1), (0.1, 1, 0), "t"))
    labels = sr.label(scene(first), "correspondence", "fundamental", "essential", next=scene(second))
    there = labels.correspondence.reshape(-1, 2)
    here = np.stack(np.meshgrid(np.arange(160) + 0.5, np.arange(120) + 0.5), axis=-1).reshape(-1, 2)
    both = np.isfinite(there).all(axis=1)
    here, there = here[both], there[both]
    assert len(here) > 5000

    f = labels.fundamental
    homogeneous = [np.append(p, 1.0)[:, None] for p in (*here[::371], *there[::371])]
    half = len(homogeneous) // 2
    squares = [cv2.sampsonDistance(a, b, f) for a, b in zip(homogeneous[:half], homogeneous[half:], strict=True)]
    assert np.sqrt(max(squares)) <= 1e-9
    found, _ = cv2.findFundamentalMat(here, there, cv2.FM_8POINT)
    signed = np.sign((found * f).sum()) * f / np.linalg.norm(f)
    assert np.abs(found / np.linalg.norm(found) - signed).max() <= 1e-7

    k = first.intrinsics()
    _, turn, shift, _ = cv2.recoverPose(labels.essential, here, there, k)
    motion = np.linalg.inv(second.world_from_camera()) @ first.world_from_camera()
    np.testing.assert_allclose(turn, motion[:3, :3], atol=1e-9)
    np.testing.assert_allclose(shift.ravel(), motion[:3, 3] / np.linalg.norm(motion[:3, 3]), atol=1e-9)
