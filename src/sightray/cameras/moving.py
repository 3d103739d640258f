"""A camera on the move."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.cameras.base import Camera, Ray, coordinates, generate_ray
from sightray.cameras.perspective import PerspectiveCamera
from sightray.cameras.pinhole import _rigid
from sightray.errors import SceneError
from sightray.fields import child, derived_array, derived_integer, derived_number, other
from sightray.mathlib.motion import Motion, plain_motion
from sightray.mathlib.moving import Pose, between_keys, inverse, point_by, stored, vector_by
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, i64_at, table_at
from sightray.mathlib.transform import Transform

SHARED = ("width", "height", "shutter_open", "shutter_close", "readout")
ALLOWED = (
    "a list of [seconds, pose]; a pose is a camera, a rigid 4x4 matrix world_from_camera, or a mapping with eye, target, "
    "up and roll"
)


def _poses(value: Any) -> Motion:
    """Keyframes as a motion of rigid poses."""
    if isinstance(value, Motion):
        return value
    try:
        keyframes = [_keyframe(entry) for entry in value]
    except TypeError:
        raise SceneError(f"got {value!r}; allowed: {ALLOWED}") from None
    return Motion(keyframes)


def _keyframe(entry: Any) -> tuple[Any, Transform]:
    if isinstance(entry, dict):
        stated = {key: part for key, part in entry.items() if key != "time"}
        entry = (entry.get("time"), stated.get("pose", stated))
    try:
        time, pose = entry
    except (TypeError, ValueError):
        raise SceneError(f"got {entry!r}; allowed: {ALLOWED}") from None
    if isinstance(pose, Camera):
        return time, _rigid(pose.world_from_camera())
    if not isinstance(pose, dict):
        return time, _rigid(pose)
    if not {"eye", "target"} <= set(pose) <= {"eye", "target", "up", "roll"}:
        raise SceneError(f"got {entry!r}; allowed: {ALLOWED}")
    return time, _rigid(PerspectiveCamera(**pose).world_from_camera())


class MovingCamera(Camera):
    """Any camera, carried along `poses`: what moves in its picture while the shutter is open is blurred.

    Poses are ``world_from_camera`` at ascending times and stand in for the camera's own; between them the eye moves
    evenly on a straight line and the camera turns evenly the shorter way round, before the first and after the last it
    stands still. Size, shutter and readout are those of `camera`. With ``readout`` the rows of a picture are exposed
    one after another (rolling shutter), each from its own pose: what stands upright leans.

    With `mount` poses are those of something that carries the camera, such as a rig or a car: the camera's own pose is
    ``pose @ mount`` at every time, also between the poses, so cameras on one rig keep their places to one another.

    `rays` and `project` speak of the middle of the exposure of each row; with a rolling shutter a projection is the
    row at whose own time the point is seen there.

    References
    ----------
    M. Meingast, C. Geyer, S. Sastry, "Geometric models of rolling-shutter cameras", OMNIVIS 2005; and `mathlib.motion`.
    """

    width: int = derived_integer("image width, pixels", lambda c: c.camera.width)
    height: int = derived_integer("image height, pixels", lambda c: c.camera.height)
    shutter_open: float = derived_number("begin of the top row's exposure, s", lambda c: c.camera.shutter_open)
    shutter_close: float = derived_number("its end, s", lambda c: c.camera.shutter_close)
    readout: float = derived_number("delay of the bottom row, s", lambda c: c.camera.readout)
    camera: Any = child("what is carried; its shutter decides when it looks", "cameras")
    poses: Motion = other("keyframes [seconds, world_from_camera]", _poses, plain=plain_motion)
    mount: Any = other("where the camera sits on what is carried, a rigid 4x4 matrix", _rigid, default=None,
                       plain=lambda mount: None if mount.is_identity else mount.matrix.tolist())  # fmt: skip
    _keys: Any = derived_array("keyframes", lambda c: c.poses.keys())
    _count: Any = derived_integer("number of keyframes", lambda c: len(c.poses.times))
    _home: Any = derived_array(
        "columns of what the poses stand in for", lambda c: (c.home() @ c.mount.inverse).T.copy()
    )

    @property
    def has_lens(self) -> bool:
        return bool(self.camera.has_lens)

    def check(self) -> None:
        for name in SHARED:
            object.__setattr__(self, name, getattr(self.camera, name))
        super().check()

    def home(self) -> np.ndarray:
        """The carried camera's own ``world_from_camera``, (4, 4)."""
        return self.camera.world_from_camera()

    def world_from_camera(self, time: Any = None) -> np.ndarray:
        """Pose at some times, (...) float, seconds: (..., 4, 4) float64; None: in the middle of the picture's exposure."""
        return self.poses.matrices(self.time_of(self.height / 2) if time is None else time) @ self.mount.matrix

    def time_of(self, y: Any) -> Any:
        """The middle of a row's exposure, seconds."""
        return 0.5 * (self.shutter_open + self.shutter_close) + np.asarray(y, np.float64) / self.height * self.readout

    def rays(self, pixels: Any, time: Any = None) -> tuple[np.ndarray, np.ndarray]:
        xy = coordinates(pixels, 2, "MovingCamera: pixels")
        o, d = self.camera.rays(xy)
        change = self.world_from_camera(self.time_of(xy[..., 1]) if time is None else time) @ np.linalg.inv(self.home())
        o = (change[..., :3, :3] @ o[..., np.newaxis])[..., 0] + change[..., :3, 3]
        return o, (change[..., :3, :3] @ d[..., np.newaxis])[..., 0]

    def project(self, points: Any, time: Any = None) -> np.ndarray:
        """As `Camera.project`; at some time, (...) float, seconds, or None: when the rows that see them are exposed."""
        p = coordinates(points, 3, "MovingCamera: points")
        if time is not None or self.readout == 0:
            return self._project(p, self.time_of(0.0) if time is None else time)
        # Find the row that sees the point at its own time: the secant method on what is seen less what was assumed.
        before = np.full(p.shape[:-1], self.height / 2)
        found = self._project(p, self.time_of(before))
        row, error = found[..., 1], found[..., 1] - before
        for _ in range(30):
            found = self._project(p, self.time_of(row))
            now = found[..., 1] - row
            slope = np.where(row != before, (now - error) / np.where(row != before, row - before, 1.0), -1.0)
            before, error = row, now
            row = row - now / np.where(slope != 0, slope, -1.0)
        return found

    def _project(self, p: np.ndarray, time: Any) -> np.ndarray:
        change = self.home() @ np.linalg.inv(self.world_from_camera(time))
        return self.camera.project((change[..., :3, :3] @ p[..., np.newaxis])[..., 0] + change[..., :3, 3])

    def resized(self, width: int, height: int) -> MovingCamera:
        """The same view with another number of pixels."""
        return self.replace(camera=self.camera.resized(width, height))


CAMERA, KEYS, COUNT, HOME = MovingCamera.offsets()[-4:]


@implements(generate_ray, MovingCamera)
def generate_moving_ray(camera: Table, x: f64, y: f64, lens_u: f64, lens_v: f64, time: f64) -> Ray:
    ray = generate_ray(table_at(camera, CAMERA), x, y, lens_u, lens_v, time)
    back = inverse(stored(table_at(camera, HOME), 0))
    pose: Pose = between_keys(table_at(camera, KEYS), i64_at(camera, COUNT), time)
    d = vector_by(pose, vector_by(back, ray.direction))
    return Ray(point_by(pose, point_by(back, ray.origin)), d)
