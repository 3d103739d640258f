"""Disparity."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.cameras.moving import MovingCamera
from sightray.errors import SceneError
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, i64_at, table_at, vec3_at
from sightray.mathlib.transform import transform_point, transform_vector
from sightray.mathlib.vec import Vec3
from sightray.vision.layers.base import Layer, fill
from sightray.vision.record import DIRECTION, PIXEL, POINT, STEREO, X, is_met, record_at
from sightray.vision.rolling import FOLLOWED, row_times
from sightray.vision.view import PROJECTION, SIDE, View, is_gone, is_linear, moved_point

ROWS = ("height", "shutter_open", "shutter_close", "readout")  # of a camera: what decides when a row is exposed
EXACT = 1e-9  # by which rectified cameras may differ, in radians and in parts of the focal length


class DisparityLayer(Layer):
    """Disparity to the other picture of a rectified pair, `stereo`: x in the left picture minus x in the right one.

    Where the two cameras share their intrinsics, f B / z with baseline B; it is the same number in both pictures, and 0
    at infinity. Cameras may move and turn together, as a rig whose second camera has a `mount`, and objects while rows are
    exposed one after the other: both cameras then expose a row at the same time, so a point is in the same row of both
    pictures, and z is its depth at that time. Where the cameras' rows have different times, or the cameras another place
    to one another in each row, what moves is seen in another row: a disparity, one number, cannot say where. There
    `correspondence` and `flow`, with the other camera as `next`, do.

    Raises
    ------
    SceneError
        If the two cameras are not rectified: pinholes whose axes, focal lengths and cy agree, side by side, at the time
        of every row; and with the same rows at the same times, where these matter.
    """

    label, unit, frame, background, picture, letters = "disparity", "pixels", "pixel", 0.0, "share_of_most", "Y"
    detail = POINT

    def pixelwise(self, frame: Any) -> bool:
        return not frame.rolls("stereo") and is_linear(frame.view.camera) and is_linear(frame.other("stereo").camera)

    def needs(self, frame: Any) -> tuple[str, ...]:
        require_rectified(frame.view, frame.other("stereo"), frame.rolls("stereo"))
        if not self.pixelwise(frame):
            return FOLLOWED
        frame.motion("stereo")
        return ()

    def compute(self, frame: Any) -> np.ndarray:
        """For cameras that move, and where each row has its own time."""
        x, there = np.arange(frame.width) + 0.5, frame.rolling("stereo").pixels[..., 0]
        side = frame.view.camera_from_world[0] @ frame.other("stereo").world_from_camera[:, 3]
        return np.where(frame.values["item"] >= 0, math.copysign(1.0, side) * (x - there), 0.0)


def require_rectified(a: View, b: View, rolls: bool) -> None:
    """Raise a `SceneError` where cameras are no rectified pair."""
    pinholes = [getattr(view.camera, "camera", view.camera) for view in (a, b)]
    if not all(map(is_linear, pinholes)):
        raise SceneError("label: stereo: disparity needs two pinhole cameras")
    moving = rolls or a.camera is not pinholes[0] or b.camera is not pinholes[1]
    rows = [[getattr(camera, name) for name in ROWS] for camera in pinholes]
    if moving and rows[0] != rows[1]:
        raise SceneError(
            f"label: stereo: what moves is in other rows of the other picture, for {', '.join(ROWS)} are {rows[0]} and "
            f"{rows[1]}; allowed: the same. Or ask for correspondence, with the other camera as next"
        )
    poses = [row_poses(view) for view in (a, b)]
    relative = np.linalg.inv(poses[0]) @ poses[1]
    turned = np.abs(relative[:, :3, :3] - np.eye(3)).max()
    apart = np.maximum(np.linalg.norm(relative[:, :3, 3], axis=1), 1e-300)
    aside = (np.abs(relative[:, 1:3, 3]).max(axis=1) / apart).max()
    lens = np.abs((a.intrinsics - b.intrinsics)[[0, 1, 1], [0, 1, 2]]).max() / a.intrinsics[0, 0]  # type: ignore
    if max(turned, aside, lens) > EXACT:
        always = ", at the time of every row: see MovingCamera.mount" if len(relative) > 1 else ""
        raise SceneError(
            f"label: stereo: the cameras are not rectified (turned by {turned:.2g}, displaced from the x axis by "
            f"{aside:.2g}, intrinsics off by {lens:.2g}); allowed: side by side, with the same axes{always}. Or ask for "
            "correspondence, with the other camera as next"
        )


def row_poses(view: View) -> np.ndarray:
    """``world_from_camera`` when each row is exposed, (h, 4, 4); one for all if the camera stands still, (1, 4, 4)."""
    if not isinstance(view.camera, MovingCamera):
        return view.world_from_camera[np.newaxis]
    return view.camera.world_from_camera(row_times(view, np.arange(view.camera.height) + 0.5))


@implements(fill, DisparityLayer)
def fill_disparity(layer: Table, frame: Table, records: Table, count: i64, out: Table) -> None:
    motion = table_at(frame, STEREO)
    side = f64_at(motion, SIDE)
    for i in range(count):
        record = record_at(records, i)
        h = Vec3(0.0, 0.0, -1.0)
        if not is_met(record):
            h = transform_vector(motion, PROJECTION, vec3_at(record, DIRECTION))
        elif not is_gone(motion, record):
            h = transform_point(motion, PROJECTION, moved_point(motion, record))
        disparity = math.nan
        if h.z > 0.0:
            disparity = side * (f64_at(record, X) - h.x / h.z)
        f64_put(out, i64_at(record, PIXEL), disparity)
