"""The loop closed end to end: a ChArUco board in rendered pictures, found by OpenCV, against its true corners and pose."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray.images import Image
from sightray.vision import back_project

pytestmark = pytest.mark.peers

SQUARES, SQUARE, TEXELS = (7, 5), 0.1, 240  # metres, texels along a square
CAMERA = {"width": 1280, "height": 960, "fx": 1400.0}


def make_board():
    """OpenCV's board, its plate in z = 0 around the origin with y up, and the corners between squares, (n, 3)."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard(SQUARES, SQUARE, 0.75 * SQUARE, dictionary)
    page = board.generateImage((SQUARES[0] * TEXELS, SQUARES[1] * TEXELS), marginSize=0) / 255.0
    picture = Image((0.02 + 0.8 * page[..., None].repeat(3, -1)).astype(np.float32))
    paint = sr.Lambert(albedo=sr.Bitmap(image=picture, filter="nearest"))
    w, h = SQUARES[0] * SQUARE, SQUARES[1] * SQUARE
    plate = sr.Rectangle(corner=(-w / 2, -h / 2, 0), edge_u=(w, 0, 0), edge_v=(0, h, 0), material=paint)
    corners = (np.array(board.getChessboardCorners(), float) - (w / 2, h / 2, 0)) * (1, -1, 1)  # its y runs down
    return board, plate, corners


TOO_FAR = pytest.mark.xfail(reason="corners 0.114 pixels RMS off at 2 m; why is not known yet", strict=True)


@pytest.mark.parametrize(
    ("distance", "lens"),
    [(0.5, {}), pytest.param(2.0, {}, marks=TOO_FAR), (4.0, {}), (1.2, {"k1": -0.15, "k2": 0.04, "p1": 1e-3})],
)
def test_corners_are_found_where_they_are(distance, lens):
    """Within 0.1 pixels RMS, the board's pose within 0.2 % of the distance; half a pixel is OpenCV's convention.

    Bytes are linear in light: the curve of sRGB would widen what is bright.
    """
    import cv2

    board, plate, corners = make_board()
    eye = distance * np.array([0.3, 0.2, 1.0]) / np.linalg.norm((0.3, 0.2, 1.0))
    pose = sr.PerspectiveCamera(eye=eye, target=(0.01, 0.02, 0)).world_from_camera()
    camera = sr.CalibratedCamera(**CAMERA, **lens, pose=pose)
    light = sr.DirectionalLight(direction=(-0.2, -0.3, -1), irradiance=3)
    picture = sr.render(sr.Scene(plate, light, camera=camera, background=0.4, transfer="floor"), sr.Whitted(),
                        samples=16)  # fmt: skip
    grey = np.ascontiguousarray(picture.to_bytes()[..., 1])
    options = cv2.aruco.DetectorParameters()
    options.cornerRefinementMinAccuracy, options.cornerRefinementMaxIterations = 1e-3, 100  # pixels; else it ends at 0.1
    detector = cv2.aruco.CharucoDetector(board, cv2.aruco.CharucoParameters(), options)
    found, ids, _, _ = detector.detectBoard(grey)
    found, true = found[:, 0].astype(float), corners[ids.ravel()]
    assert len(found) >= 6

    error = found + 0.5 - camera.project(true)
    assert np.sqrt((error**2).sum(-1).mean()) <= 0.1
    assert np.abs(error.mean(axis=0)).max() <= 0.05

    k = camera.intrinsics() - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    solved, turn, shift = cv2.solvePnP(true, found, k, np.array([camera.k1, camera.k2, camera.p1, camera.p2]))
    expected = np.linalg.inv(pose)
    assert solved
    assert np.linalg.norm(shift.ravel() - expected[:3, 3]) <= 0.002 * distance
    assert np.abs(cv2.Rodrigues(turn)[0] - expected[:3, :3]).max() <= 0.005

    away = back_project(found + 0.5, camera, plate).points - true
    metres_per_pixel = 1.3 * distance / camera.fx  # the board leans by 20 degrees
    assert np.sqrt((away**2).sum(-1).mean()) <= 0.1 * metres_per_pixel
