"""Cameras: what every one promises, and that their many descriptions mean the same."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sightray._jit import kernel, native
from sightray.cameras.base import sight_ray
from sightray.cameras.calibrated import CalibratedCamera
from sightray.cameras.fisheye import FisheyeCamera
from sightray.cameras.moving import MovingCamera
from sightray.cameras.orthographic import OrthographicCamera
from sightray.cameras.panorama import PanoramaCamera
from sightray.cameras.perspective import PerspectiveCamera
from sightray.cameras.pinhole import PinholeCamera
from sightray.cameras.thinlens import ThinLensCamera
from sightray.cameras.window import WindowCamera
from sightray.errors import SceneError
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, vec3_put
from sightray.mathlib.transform import Transform
from sightray.registry import members
from sightray.scene.compile import Tables

VIEW = {"eye": (3, 4, 5), "target": (-1, 0.5, 0), "up": (0.1, 1, 0)}
POSE = (Transform.translate(1, -2, 3) @ Transform.rotate((1, 2, 3), 70)).matrix
EXAMPLES = {
    "PerspectiveCamera": [
        PerspectiveCamera(),
        PerspectiveCamera(**VIEW, roll=30, pixel_aspect=1.5, vfov=100, width=99),
    ],
    "WindowCamera": [WindowCamera(), WindowCamera(**VIEW, left=0.2, right=3, bottom=-2, top=-1, distance=0.7)],
    "PinholeCamera": [PinholeCamera(fx=500), PinholeCamera(fx=800, fy=300, cx=-50, cy=99.5, pose=POSE, height=200)],
    "OrthographicCamera": [OrthographicCamera(), OrthographicCamera(**VIEW, roll=-70, pixel_aspect=0.5, view_height=9)],
    "ThinLensCamera": [
        ThinLensCamera(lens_radius=0.2),
        ThinLensCamera(**VIEW, roll=20, vfov=70, f_number=1.4, focus_distance=3, blades=5, blade_rotation=10),
    ],
    "PanoramaCamera": [
        PanoramaCamera(hfov=350, vfov=170, width=800),
        PanoramaCamera(**VIEW, roll=40, projection="cylindrical", hfov=270, vfov=120),
    ],
    "FisheyeCamera": [
        FisheyeCamera(**VIEW, roll=10, fov=220),
        FisheyeCamera(projection="equisolid", fov=200, circle=1.3, width=301, height=200),
        FisheyeCamera(projection="stereographic", fov=300),
        FisheyeCamera(projection="orthographic", fov=170, circle=1.7),
    ],
    "MovingCamera": [
        MovingCamera(camera=PinholeCamera(fx=500, pose=POSE, shutter_close=0.5), poses=[(0, VIEW), (1, POSE)]),
        MovingCamera(camera=OrthographicCamera(readout=0.1),
                     poses=[(-1, POSE), (1, Transform.translate(4, 0, 0) @ Transform(POSE))]),
        MovingCamera(camera=PinholeCamera(fx=300, shutter_close=0.2), poses=[(0, VIEW), (1, POSE)],
                     mount=Transform.translate(0.2, 0, 0) @ Transform.rotate((0, 1, 0), 20)),
    ],
    "CalibratedCamera": [
        CalibratedCamera(fx=500, fy=510, cx=330, cy=236.5, skew=1.5, k1=-0.28, k2=0.07, p1=1e-3, p2=-5e-4, pose=POSE),
        CalibratedCamera(fx=400, k1=4.1, k2=2.9, k3=0.1, k4=4.4, k5=3.7, k6=0.5, p1=-2e-4, p2=1e-4),
        CalibratedCamera(fx=260, cx=310, k1=-0.05, k2=1e-3, k4=-1e-5, model="kannala_brandt", pose=POSE),
    ],
}
EVERY = [pytest.param(c, id=f"{name}-{i}") for name, all_of in EXAMPLES.items() for i, c in enumerate(all_of)]


@kernel
def ask(camera: Table, count: i64, pixels: Table, rays: Table) -> i64:
    """`sight_ray` for many pixels."""
    for i in range(count):
        ray = sight_ray(camera, f64_at(pixels, 2 * i), f64_at(pixels, 2 * i + 1), 0.5, 0.5, 0.5)
        vec3_put(rays, 8 * i, ray.origin)
        vec3_put(rays, 8 * i + 4, ray.direction)
    return count


def kernel_rays(camera, pixels: np.ndarray, compiled: bool = True) -> tuple[np.ndarray, np.ndarray]:
    tables = Tables()
    row = tables.row_of(camera)
    tables.prepare(ask, compiled=compiled)
    out = np.zeros((len(pixels), 8))
    (native(ask) if compiled else ask)(row, len(pixels), Table(pixels), Table(out))
    return out[:, :3], out[:, 4:7]


def some_pixels(camera, count: int = 100, seed: int = 0) -> np.ndarray:
    """Random places in the image, its corners and its middle."""
    size = np.array([camera.width, camera.height])
    inside = np.random.default_rng(seed).uniform(0, 1, (count, 2)) * size
    return np.vstack([inside, np.array([(0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5)]) * size])


def sighted(directions: np.ndarray) -> np.ndarray:
    """Which rays are rays: those of pixels that see nothing have no length."""
    return directions.any(axis=-1)


def sees_all(camera) -> np.ndarray | bool:
    """Which of `some_pixels` see anything: all, but for fisheyes with corners outside their circle."""
    if not isinstance(camera, FisheyeCamera):
        return True
    size = np.array([camera.width, camera.height])
    return np.linalg.norm(some_pixels(camera) - size / 2, axis=1) <= camera.circle * size.min() / 2


def same_picture(a, b, tolerance: float = 1e-12) -> None:
    assert (a.width, a.height) == (b.width, b.height)
    for mine, other in zip(kernel_rays(a, some_pixels(a)), kernel_rays(b, some_pixels(a)), strict=True):
        np.testing.assert_allclose(mine, other, atol=tolerance)


def test_no_camera_lacks_an_example():
    assert set(EXAMPLES) == {n for n, cls in members("cameras").items() if cls.__module__.startswith("sightray.")}


@pytest.mark.parametrize("camera", EVERY)
def test_machine_code_python_and_numpy_make_the_same_rays(camera):
    pixels = some_pixels(camera)
    arrays = camera.rays(pixels)
    for compiled in (True, False):
        for found, expected in zip(kernel_rays(camera, pixels, compiled), arrays, strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(arrays[1], axis=1), sighted(arrays[1]), rtol=1e-15)
    assert sighted(arrays[1])[-1]
    assert (sees_all(camera) == sighted(arrays[1])).all()


@pytest.mark.parametrize("camera", EVERY)
@pytest.mark.parametrize("distance", [0.1, 1.0, 1e4])
def test_points_along_a_ray_project_to_its_pixel(camera, distance):
    pixels = some_pixels(camera)
    origins, directions = camera.rays(pixels)
    seen = sighted(directions)
    assert np.abs(camera.project(origins + distance * directions) - pixels)[seen].max() <= 1e-9


@pytest.mark.parametrize("camera", EVERY)
def test_points_behind_are_nan_and_shapes_are_kept(camera):
    pose = camera.world_from_camera()
    behind = pose[:3, 3] - pose[:3, 2]
    assert np.isnan(camera.project(behind)).all() != isinstance(camera, PanoramaCamera)
    assert camera.project(behind).shape == (2,)
    assert camera.project(np.zeros((4, 5, 3))).shape == (4, 5, 2)
    assert [a.shape for a in camera.rays(np.zeros((4, 5, 2)))] == [(4, 5, 3)] * 2
    assert camera.project(np.zeros((0, 3))).shape == (0, 2)


@pytest.mark.parametrize("camera", EVERY)
def test_pose_is_rigid_and_the_picture_is_upright(camera):
    pose = camera.world_from_camera()
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-14)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    ahead = pose[:3, 3] + 2 * pose[:3, 2]
    x, y = camera.project(ahead)
    assert camera.project(ahead + 0.1 * pose[:3, 0])[1] == pytest.approx(y, abs=0.01)  # lenses may be off centre
    assert camera.project(ahead + 0.1 * pose[:3, 0])[0] > x
    assert camera.project(ahead + 0.1 * pose[:3, 1])[1] > y


@pytest.mark.parametrize("camera", EVERY)
def test_another_size_shows_the_same_view(camera):
    """Twice the pixels both ways: every place of the picture keeps its ray."""
    larger = camera.resized(2 * camera.width, 2 * camera.height)
    pixels = some_pixels(camera)
    for mine, other in zip(camera.rays(pixels), larger.rays(2 * pixels), strict=True):
        np.testing.assert_allclose(mine, other, atol=1e-13)


@pytest.mark.parametrize("camera", EVERY)
def test_plain_values_make_the_same_camera(camera):
    plain = {name: camera.fields[name].plain(value) for name, value in camera.values().items()}
    same_picture(camera, type(camera)(**plain), 0)


# --- one camera, many descriptions ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "height", "vfov"), [(640, 480, 40), (200, 300, 90), (1, 1, 20)])
def test_field_of_view_window_and_intrinsics_describe_one_camera(width, height, vfov):
    perspective = PerspectiveCamera(**VIEW, vfov=vfov, width=width, height=height)
    top = 2.5 * math.tan(math.radians(vfov / 2))
    right = top * width / height
    size = {"width": width, "height": height}
    window = WindowCamera(**VIEW, left=-right, right=right, bottom=-top, top=top, distance=2.5, **size)
    f = height / 2 / math.tan(math.radians(vfov / 2))
    pinhole = PinholeCamera(fx=f, pose=perspective.world_from_camera(), **size)
    same_picture(perspective, window)
    same_picture(perspective, pinhole)


def test_non_square_pixels():
    """Pixels 1.5 times as wide as high: the same height is seen, and 1.5 times the width."""
    wide = PerspectiveCamera(**VIEW, vfov=50, pixel_aspect=1.5, width=400, height=400)
    top = math.tan(math.radians(25))
    same_picture(wide, WindowCamera(**VIEW, left=-1.5 * top, right=1.5 * top, bottom=-top, top=top, distance=1,
                                    width=400, height=400))  # fmt: skip
    f = 200 / top
    same_picture(wide, PinholeCamera(fx=f / 1.5, fy=f, pose=wide.world_from_camera(), width=400, height=400))
    flat = OrthographicCamera(view_height=2, pixel_aspect=1.5, width=100, height=50)
    assert flat.project((3, 1, 0)) == pytest.approx((100, 0))  # 100 pixels of 0.06 m


def test_two_windows_off_the_middle_are_the_halves_of_one():
    whole = WindowCamera(**VIEW, left=-1, right=1, bottom=-1, top=1, width=64, height=64)
    right = WindowCamera(**VIEW, left=0, right=1, bottom=-1, top=0, width=32, height=32)
    pixels = some_pixels(right)
    np.testing.assert_allclose(right.rays(pixels)[1], whole.rays(pixels + 32)[1], atol=1e-14)


def test_the_window_stands_where_it_is_said_to_stand():
    camera = WindowCamera(eye=(0, 0, 5), target=(0, 0, 0), left=-1, right=3, bottom=-2, top=0.5, distance=2)
    assert camera.project((-1, 0.5, 3)) == pytest.approx((0, 0), abs=1e-12)
    assert camera.project((3, -2, 3)) == pytest.approx((640, 480))


def test_vfov_spans_the_height():
    camera = PerspectiveCamera(eye=(0, 0, 5), target=(0, 0, 0), vfov=90, width=100, height=100)
    assert camera.project((0, 5, 0)) == pytest.approx((50, 0))
    assert camera.project((5, 0, 0)) == pytest.approx((100, 50))


@pytest.mark.parametrize("kind", [PerspectiveCamera, OrthographicCamera])
def test_a_clockwise_roll_turns_the_picture_counter_clockwise(kind):
    """What stood at twelve o'clock stands at nine."""
    x, y = kind(roll=90, width=100, height=100).project((0, 0.5, 0))
    assert x < 49
    assert y == pytest.approx(50)


def test_the_default_pinhole_is_opencvs_frame():
    camera = PinholeCamera(fx=100, width=640, height=480)
    assert camera.project((1, 2, 10)) == pytest.approx((330, 260))
    np.testing.assert_allclose(camera.rays((320, 240))[1], (0, 0, 1), atol=1e-15)


def test_orthographic_size_does_not_depend_on_depth():
    camera = OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), view_height=4, width=200, height=100)
    for z in (5, 0, -100):
        assert camera.project((4, 2, z)) == pytest.approx((200, 0))
        assert camera.project((-4, -2, z)) == pytest.approx((0, 100))


def test_beams_are_as_wide_as_pixels():
    """Those of an orthographic camera everywhere, those of all others ever more with distance."""
    flat = OrthographicCamera(view_height=4, width=200, height=100, pixel_aspect=2)
    assert flat.pixel_distance() == pytest.approx(0.08)
    assert flat.pixel_angle() == 0
    square = {"width": 100, "height": 100, "vfov": 90}
    for camera in (PerspectiveCamera(**square), ThinLensCamera(**square, lens_radius=1)):
        assert camera.pixel_distance() == 0
        assert camera.pixel_angle() == pytest.approx(0.02, rel=1e-3)
    assert PanoramaCamera(width=360, height=180).pixel_angle() == pytest.approx(math.radians(1))


MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(("make", "message"), [
    (lambda: PinholeCamera(), r"PinholeCamera\.fx: missing"),
    (lambda: PinholeCamera(fx=0), r"PinholeCamera\.fx: got 0; allowed: a finite number > 0 \(pixels\)"),
    (lambda: PinholeCamera(fx=1, pose=2 * np.eye(4)), r"PinholeCamera\.pose: .*last row"),
    (lambda: PinholeCamera(fx=1, pose=np.diag([1, 1, 1.1, 1])), r"axes are not orthonormal \(off by 0\.21\)"),
    (lambda: PinholeCamera(fx=1, pose=MIRRORED), r"PinholeCamera\.pose: .*mirror image \(determinant -1\)"),
    (lambda: WindowCamera(left=1, right=1), r"WindowCamera: left 1 is not below right 1"),
    (lambda: WindowCamera(bottom=2), r"WindowCamera: bottom 2 is not below top 0\.75"),
    (lambda: WindowCamera(distance=-1), r"WindowCamera\.distance: got -1"),
    (lambda: WindowCamera(up=(0, 0, 1)), r"WindowCamera: up \(0\.0, 0\.0, 1\.0\) is parallel to the line of sight"),
    (lambda: OrthographicCamera(target=(0, 0, 5)), r"OrthographicCamera: eye and target are the same point"),
    (lambda: OrthographicCamera(view_height=0), r"OrthographicCamera\.view_height: got 0"),
    (lambda: PerspectiveCamera().project((1, 2)), r"PerspectiveCamera: points: got an array of shape \(2,\); allowed"),
    (lambda: PerspectiveCamera().project("here"), r"PerspectiveCamera: points: got 'here'"),
    (lambda: OrthographicCamera().rays(3), r"OrthographicCamera: pixels: .*shape \(\); allowed: \(\.\.\., 2\)"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()
