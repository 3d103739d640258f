"""Boards and tags of OpenCV as scenes, and pictures of them by a lens whose point spread is known."""

from __future__ import annotations

from typing import Any

import numpy as np

import sightray as sr
from sightray.images import Image

SQUARES, SQUARE, TEXELS = (7, 5), 0.1, 240  # metres, texels along a square
TAG, TAG_ID, CELLS, QUIET = 0.2, 7, 8, 2  # metres, cells of a tag with its border, and white cells around it
PAGE = TAG * (CELLS + 2 * QUIET) / CELLS  # metres: a tag with its margin
AXIS = np.array([0.3, 0.2, 1.0]) / np.linalg.norm((0.3, 0.2, 1.0))  # from a board to the camera: it leans by 20 degrees
PSF = sr.GaussianFilter(radius=2.1, sigma=0.7)  # pixels: a lens that just resolves its pixels


def plate(page: np.ndarray, width: float, height: float) -> sr.Rectangle:
    """A printed page, its middle in the origin, z = 0, y up."""
    picture = Image((0.02 + 0.8 * page[..., None].repeat(3, -1)).astype(np.float32))
    paint = sr.Lambert(albedo=sr.Bitmap(image=picture, filter="nearest"))
    return sr.Rectangle(
        corner=(-width / 2, -height / 2, 0), edge_u=(width, 0, 0), edge_v=(0, height, 0), material=paint
    )


def charuco() -> tuple[Any, sr.Rectangle, np.ndarray]:
    """OpenCV's board, its plate, and the corners between squares, (n, 3)."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard(SQUARES, SQUARE, 0.75 * SQUARE, dictionary)
    page = board.generateImage((SQUARES[0] * TEXELS, SQUARES[1] * TEXELS), marginSize=0) / 255.0
    w, h = SQUARES[0] * SQUARE, SQUARES[1] * SQUARE
    corners = (np.array(board.getChessboardCorners(), float) - (w / 2, h / 2, 0)) * (1, -1, 1)  # its y runs down
    return board, plate(page, w, h), corners


def tag_page() -> np.ndarray:
    """A tag of the family 36h11 in its white margin, from 0 to 1."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    page = np.ones((100 * (CELLS + 2 * QUIET),) * 2)
    page[100 * QUIET : -100 * QUIET, 100 * QUIET : -100 * QUIET] = (
        cv2.aruco.generateImageMarker(dictionary, TAG_ID, 100 * CELLS, borderBits=1) / 255.0
    )
    return page


def apriltag() -> tuple[sr.Rectangle, np.ndarray]:
    """The tag as a scene, and its corners, (4, 3), clockwise from the top left."""
    side, c = PAGE, TAG / 2
    return plate(tag_page(), side, side), np.array([(-c, c, 0), (c, c, 0), (c, -c, 0), (-c, -c, 0)])


def camera_at(distance: float, **lens: float) -> sr.CalibratedCamera:
    """A camera of 1280 x 960 pixels, that far from the origin."""
    pose = sr.PerspectiveCamera(eye=distance * AXIS, target=(0.01, 0.02, 0)).world_from_camera()
    return sr.CalibratedCamera(width=1280, height=960, fx=1400.0, **lens, pose=pose)


def grey_picture(page: sr.Rectangle, camera: sr.Camera, samples: int = 32, filter: Any = PSF) -> np.ndarray:
    """What the camera delivers, (h, w) uint8: linear in light, for the curve of sRGB would widen what is bright."""
    light = sr.DirectionalLight(direction=(-0.2, -0.3, -1), irradiance=3)
    scene = sr.Scene(page, light, camera=camera, background=0.4, transfer="floor")
    picture = sr.render(scene, sr.Whitted(), samples=samples, filter=filter)
    return np.ascontiguousarray(picture.to_bytes()[..., 1])


def perfect_tag(camera: sr.CalibratedCamera, levels: tuple[float, float, float], half: int = 150) -> tuple[Any, Any]:
    """The tag through `PSF` by numpy alone, without noise: the first pixel (x, y), and (2 half, 2 half).

    `levels` are those of black, white, and what is around the page.
    """
    page, fine = tag_page(), 6
    x, y = np.floor(camera.project(np.zeros(3))).astype(int) - half
    ticks = (np.arange(2 * half * fine) + 0.5) / fine
    across = camera.intrinsics() @ np.linalg.inv(camera.world_from_camera())[:3][:, [0, 1, 3]]
    columns, rows = np.meshgrid(x + ticks, y + ticks)
    u, v, w = np.einsum("ij,jhw->ihw", np.linalg.inv(across), np.stack([columns, rows, np.ones_like(rows)]))
    places = np.floor(np.stack([0.5 - v / w / PAGE, u / w / PAGE + 0.5]) * len(page)).astype(int)
    on = ((places >= 0) & (places < len(page))).all(axis=0)
    light = np.full(on.shape, levels[2])
    light[on] = np.where(page[places[0][on], places[1][on]] > 0.5, levels[1], levels[0])
    away = ticks - (np.arange(2 * half)[:, None] + 0.5)
    weights = np.maximum(np.exp(-(away**2) / (2 * PSF.sigma**2)) - np.exp(-(PSF.radius**2) / (2 * PSF.sigma**2)), 0)
    weights /= weights.sum(axis=1, keepdims=True)
    return np.array([x, y]), weights @ light @ weights.T


def charuco_corners(board: Any, grey: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners that OpenCV finds, (n, 2), the centre of the top-left pixel at (0, 0); and which they are."""
    import cv2

    options = cv2.aruco.DetectorParameters()
    options.cornerRefinementMinAccuracy, options.cornerRefinementMaxIterations = (
        1e-3,
        100,
    )  # pixels; else it ends at 0.1
    found, ids, _, _ = cv2.aruco.CharucoDetector(board, cv2.aruco.CharucoParameters(), options).detectBoard(grey)
    return found[:, 0].astype(float), ids.ravel()


def opencv_matrix(camera: sr.CalibratedCamera) -> np.ndarray:
    """K in OpenCV's convention, the centre of the top-left pixel at (0, 0)."""
    return camera.intrinsics() - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]


def rms(error: np.ndarray) -> float:
    """Root mean square of lengths."""
    return float(np.sqrt((np.asarray(error) ** 2).sum(axis=-1).mean()))
