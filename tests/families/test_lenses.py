"""Lenses and panoramas: what each one says about where a point is seen."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel, native
from sightray.cameras import brown_conrady, kannala_brandt
from sightray.cameras.base import sight_ray
from sightray.cameras.calibrated import CalibratedCamera
from sightray.cameras.fisheye import FisheyeCamera
from sightray.cameras.panorama import PanoramaCamera
from sightray.cameras.perspective import PerspectiveCamera
from sightray.cameras.thinlens import ThinLensCamera, place_on_lens
from sightray.errors import SceneError
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, vec3_put
from sightray.scene.compile import Tables

AHEAD = {"eye": (0, 0, 0), "target": (0, 0, -1)}  # the camera's +z is the world's -z


@kernel
def ask(camera: Table, count: i64, places: Table, rays: Table) -> i64:
    """`sight_ray` for many x, y, lens_u, lens_v."""
    for i in range(count):
        x, y, u, v = f64_at(places, 4 * i), f64_at(places, 4 * i + 1), f64_at(places, 4 * i + 2), f64_at(places, 4 * i + 3)
        ray = sight_ray(camera, x, y, u, v, 0.5)
        vec3_put(rays, 8 * i, ray.origin)
        vec3_put(rays, 8 * i + 4, ray.direction)
    return count


def lens_rays(camera, places) -> tuple[np.ndarray, np.ndarray]:
    """(n, 4) places x, y, lens_u, lens_v -> origins and directions."""
    places = np.ascontiguousarray(places, np.float64)
    tables, out = Tables(), np.zeros((len(places), 8))
    row = tables.row_of(camera)
    tables.prepare(ask)
    native(ask)(row, len(places), Table(places), Table(out))
    return out[:, :3], out[:, 4:7]


# --- thin lens -----------------------------------------------------------------------------------------------------


def test_a_lens_without_width_is_a_pinhole_to_the_last_bit():
    view = {"eye": (3, 4, 5), "target": (-1, 0.5, 0), "vfov": 70, "roll": 20}
    places = np.random.default_rng(0).uniform(0, 1, (200, 4)) * (640, 480, 1, 1)
    mine = lens_rays(ThinLensCamera(**view, lens_radius=0), places)
    np.testing.assert_array_equal(mine, lens_rays(PerspectiveCamera(**view), places))
    assert ThinLensCamera().aperture() == 0
    assert ThinLensCamera(f_number=2.0, focal_length=0.1).aperture() == 0.025
    assert ThinLensCamera(eye=(0, 0, 5), target=(3, 4, 5)).in_focus() == 5


@pytest.mark.parametrize("blades", [0, 3, 6])
def test_rays_of_a_pixel_meet_in_the_plane_of_focus_only(blades):
    """And at another depth z they are spread over fy r |1/focus - 1/z| pixels."""
    camera = ThinLensCamera(**AHEAD, vfov=60, lens_radius=0.1, focus_distance=4, blades=blades)
    lens = np.random.default_rng(1).uniform(0, 1, (500, 2))
    places = np.column_stack([np.full(500, 200.0), np.full(500, 77.0), lens])
    o, d = lens_rays(camera, places)
    meeting = o + d * (-4 / d[:, 2])[:, None]
    assert np.ptp(meeting, axis=0).max() < 1e-14
    np.testing.assert_allclose(camera.project(meeting[0]), (200, 77), atol=1e-10)

    # The lens is in the plane through the eye, and a point behind the focus is blurred by the formula's radius.
    assert np.abs(o[:, 2]).max() == 0
    z, fy = 10.0, 240 / math.tan(math.radians(30))
    spread = camera.project(o + d * (-z / d[:, 2])[:, None]) - (200, 77)
    reach = np.linalg.norm(spread, axis=1).max() / (fy * 0.1 * abs(1 / 4 - 1 / z))
    assert 0.93 < reach <= 1 + 1e-9


@pytest.mark.parametrize("blades", [0, 3, 4, 7])
def test_lens_coordinates_cover_the_aperture_evenly(blades):
    """The map keeps areas: so many of a fine grid's cells fall into any part as its area says; the middle stays."""
    n, turn = 200, 0.3
    grid = (np.arange(n) + 0.5) / n
    p = np.array([tuple(place_on_lens(u, v, blades, turn))[:2] for u in grid for v in grid])
    assert tuple(place_on_lens(0.5, 0.5, blades, turn)) == (0, 0, 0)
    angle = np.mod(np.arctan2(p[:, 1], p[:, 0]) - turn, 2 * math.pi)
    step = 2 * math.pi / max(blades, 3)
    edge = np.cos(step / 2) / np.cos(angle % step - step / 2) if blades else np.ones(n * n)
    r = np.linalg.norm(p, axis=1) / edge  # 1 on the edge of the aperture
    assert 0.99 < r.max() <= 1 + 1e-12
    for part in (0.3, 0.7):
        assert np.mean(r < part) == pytest.approx(part**2, abs=0.01)
        assert np.mean(angle < part * step) == pytest.approx(slice_of(part, blades, step), abs=0.01)


def slice_of(part: float, blades: int, step: float) -> float:
    """Share of the aperture within an angle from a corner, `part` of a side's."""
    if not blades:
        return part * step / (2 * math.pi)
    inside = 0.5 * (1 + math.tan(step * (part - 0.5)) / math.tan(step / 2))  # of the side's length
    return inside / blades


def test_the_map_to_the_aperture_is_continuous():
    steps = np.linspace(0.001, 0.999, 4000)
    for blades in (0, 5):
        for line in [(steps, 0.3), (steps, 0.9), (0.2, steps), (steps, steps)]:
            squares = zip(*np.broadcast_arrays(*line), strict=True)
            p = np.array([tuple(place_on_lens(u, v, blades, 0.0)) for u, v in squares])
            assert np.linalg.norm(np.diff(p, axis=0), axis=1).max() < 0.003


# --- panoramas -----------------------------------------------------------------------------------------------------


def test_an_equirectangular_panorama_is_linear_in_heading_and_pitch():
    camera = PanoramaCamera(**AHEAD, width=720, height=360)
    for heading, pitch in [(0, 0), (90, 0), (-90, 30), (179, -60), (10, 89)]:
        a, b = math.radians(heading), math.radians(pitch)
        p = (math.sin(a) * math.cos(b), math.sin(b), -math.cos(a) * math.cos(b))  # right of -z is +x
        np.testing.assert_allclose(camera.project(p), (360 + 2 * heading, 180 - 2 * pitch), atol=1e-10)
    o, d = camera.rays([(0, 180), (720, 180), (100, 0), (100, 360)])
    np.testing.assert_allclose(d, [(0, 0, 1), (0, 0, 1), (0, 1, 0), (0, -1, 0)], atol=1e-15)
    assert (o == 0).all()
    assert np.isnan(camera.project((0, 0, 0))).all()


def test_a_cylinder_shows_planar_views_by_szeliskis_formulas():
    """A view with focal length f at pan p: column offset x goes to p + atan(x/f), height y to y / sqrt(f² + x²)."""
    camera = PanoramaCamera(**AHEAD, projection="cylindrical", vfov=100, width=1000, height=400)
    f, pan, top = 300.0, 0.7, math.tan(math.radians(50))
    turned = PerspectiveCamera(eye=(0, 0, 0), target=(math.sin(pan), 0, -math.cos(pan)), width=400, height=300,
                               vfov=2 * math.degrees(math.atan(150 / f)))  # fmt: skip
    pixels = np.random.default_rng(2).uniform((0, 0), (400, 300), (50, 2))
    x, y = pixels[:, 0] - 200, 150 - pixels[:, 1]
    expected = np.column_stack([500 + 1000 * (pan + np.arctan(x / f)) / (2 * math.pi),
                                200 - 200 * (y / np.hypot(f, x)) / top])  # fmt: skip
    np.testing.assert_allclose(camera.project(turned.rays(pixels)[1] * 7), expected, atol=1e-10)


def test_a_view_cut_from_a_panorama_is_a_perspective_picture():
    """From the same eye, pixel for pixel, as far as the panorama's own pixels allow."""
    checks = sr.Bitmap(image=np.array([[0.2, 0.8], [0.8, 0.2]]), filter="nearest", scale=2)  # as hard for both cameras
    scene = sr.Scene(
        sr.Rectangle(corner=(-3, -1, -1), edge_u=(6, 0, 0), edge_v=(0, 0, -5),
                     material=sr.Phong(diffuse=0, specular=0, ambient=checks)),
        sr.Sphere(center=(1, 0, -4), material=sr.Phong(diffuse=0, specular=0, ambient=(0.9, 0.2, 0.1))),
        ambient=1.0, background=(0.2, 0.4, 0.9),
    )  # fmt: skip
    view = PerspectiveCamera(eye=(0, 0, 0), target=(0.5, -0.2, -1), vfov=50, width=80, height=60)
    y, x = np.indices((60, 80)) + 0.5
    directions = view.rays(np.stack([x, y], axis=-1))[1]
    expected = np.asarray(sr.render(scene.replace(camera=view), sr.Whitted(), samples=1))
    for camera in (PanoramaCamera(**AHEAD, width=2000, height=1000),
                   PanoramaCamera(**AHEAD, projection="cylindrical", vfov=100, width=2000, height=700)):  # fmt: skip
        panorama = np.asarray(sr.render(scene.replace(camera=camera), sr.Whitted(), samples=1))
        column, row = np.floor(camera.project(directions)).astype(int).transpose(2, 0, 1)
        assert np.mean(np.abs(panorama[row, column] - expected).max(axis=2) > 0.01) < 0.03  # edges fall within pixels


# --- fisheyes ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("projection", "radius"), [
    ("equidistant", lambda a: a), ("equisolid", lambda a: 2 * math.sin(a / 2)),
    ("stereographic", lambda a: 2 * math.tan(a / 2)), ("orthographic", math.sin),
])  # fmt: skip
def test_fisheyes_see_angles_at_the_radius_of_their_formula(projection, radius):
    camera = FisheyeCamera(**AHEAD, projection=projection, fov=180, width=400, height=300)
    for angle in (0, 0.3, 1.2, math.pi / 2):
        for around in (0.0, 1.0, 4.0):
            p = np.array((math.sin(angle) * math.cos(around), -math.sin(angle) * math.sin(around), -math.cos(angle)))
            r = 150 * radius(angle) / radius(math.pi / 2)
            expected = (200 + r * math.cos(around), 150 + r * math.sin(around))
            np.testing.assert_allclose(camera.project(5 * p), expected, atol=1e-9)
    outside = camera.rays([(0, 0), (200, 301), (200, 300)])[1]
    assert outside.any(axis=1).tolist() == [False, False, True]


def test_beside_the_image_circle_a_picture_is_black():
    camera = FisheyeCamera(fov=200, width=60, height=40)
    picture = np.asarray(sr.render(sr.Scene(sr.Sphere(), camera=camera, background=1.0), sr.PathTracer(), samples=1))
    y, x = np.indices((40, 60)) + 0.5
    r = np.hypot(x - 30, y - 20)
    assert (picture[r > 20] == 0).all()
    assert (picture[(r < 20) & (r > 10)] == 1).all()
    explained = sr.explain(sr.Scene(sr.Sphere(), camera=camera, background=1.0), pixel=(0, 0))
    assert explained.color == (0, 0, 0)
    assert explained.rays == 0


def test_equal_solid_angles_take_equal_areas():
    camera = FisheyeCamera(projection="equisolid", fov=180, circle=0.9, width=101, height=101)
    x, y = np.meshgrid(np.arange(5, 96, 10.0), np.arange(5, 96, 10.0))
    corners = np.stack([np.stack([x + a, y + b], axis=-1) for a, b in ((0, 0), (1e-3, 0), (0, 1e-3))])
    _, (a, b, c) = camera.rays(corners)
    seen = a.any(-1) & b.any(-1) & c.any(-1)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1)[seen]
    np.testing.assert_allclose(area, area.mean(), rtol=1e-4)


# --- calibrated cameras --------------------------------------------------------------------------------------------

LENSES = {
    "barrel": {"k1": -0.28, "k2": 0.07, "p1": 1e-3, "p2": -5e-4},
    "pincushion": {"k1": 0.2, "k2": 0.05, "k3": 0.01},
    "rational": {"k1": 4.1, "k2": 2.9, "k3": 0.1, "k4": 4.4, "k5": 3.7, "k6": 0.5, "p1": -2e-4, "p2": 1e-4},
    "tangential": {"p1": 0.01, "p2": -0.02},
    "fisheye": {"k1": -0.01, "k2": 0.003, "k3": -1e-3, "k4": 1e-4, "model": "kannala_brandt"},
}


@pytest.mark.parametrize("lens", LENSES)
def test_the_kernel_undistorts_to_rounding_error(lens):
    """A line of sight, distorted by the formula as the books write it, is back where the pixel is."""
    camera = CalibratedCamera(fx=500, fy=480, cx=300, cy=250, skew=2, **LENSES[lens])
    pixels = np.random.default_rng(3).uniform(0, 1, (300, 2)) * (640, 480)
    _, d = lens_rays(camera, np.column_stack([pixels, np.full((300, 2), 0.5)]))
    assert d.any(axis=1).all()
    u, v = by_the_book(d, **LENSES[lens])
    np.testing.assert_allclose(500 * u + 2 * v + 300, pixels[:, 0], rtol=0, atol=2e-12 * 500)
    np.testing.assert_allclose(480 * v + 250, pixels[:, 1], rtol=0, atol=2e-12 * 480)


def by_the_book(d, *, k1=0.0, k2=0.0, k3=0.0, k4=0.0, k5=0.0, k6=0.0, p1=0.0, p2=0.0, model="brown_conrady"):
    if model == "kannala_brandt":
        a = np.arctan2(np.hypot(d[:, 0], d[:, 1]), d[:, 2])
        r = a + k1 * a**3 + k2 * a**5 + k3 * a**7 + k4 * a**9
        return r * d[:, :2].T / np.hypot(d[:, 0], d[:, 1])
    x, y = d[:, 0] / d[:, 2], d[:, 1] / d[:, 2]
    r = np.hypot(x, y)
    c = (1 + k1 * r**2 + k2 * r**4 + k3 * r**6) / (1 + k4 * r**2 + k5 * r**4 + k6 * r**6)
    return (x * c + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2), y * c + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y)


def test_beyond_the_turn_of_the_polynomial_nothing_is_seen():
    """r (1 - 0.3 r²) grows up to r = 1/sqrt(0.9), where it is 2/3 of that."""
    camera = CalibratedCamera(fx=300, k1=-0.3, width=640, height=480)
    end = 1 / math.sqrt(0.9)
    assert camera.reach() == pytest.approx(end**2)
    rim = 300 * end * 2 / 3
    inside, outside = camera.rays([(320 + rim - 1e-6, 240), (320 + rim + 1e-6, 240)])[1]
    assert inside[0] / inside[2] == pytest.approx(end, abs=1e-3)
    assert not outside.any()
    assert np.isfinite(camera.project((end - 1e-9, 0, 1))).all()
    assert np.isnan(camera.project((end + 1e-9, 0, 1))).all()
    assert not lens_rays(camera, [(320 + rim + 1e-6, 240, 0.5, 0.5)])[1].any()


def test_a_fisheye_sees_behind_itself():
    camera = CalibratedCamera(fx=200, model="kannala_brandt")
    np.testing.assert_allclose(camera.project((1, 0, -1)), (320 + 200 * 0.75 * math.pi, 240))
    assert kannala_brandt.reach(np.array([-0.1, 0, 0, 0])) == pytest.approx(math.sqrt(1 / 0.3))
    assert brown_conrady.reach(np.zeros(8)) == math.inf
    narrow = CalibratedCamera(fx=200, model="kannala_brandt", k1=-0.1)  # its rim is where 3 k1 theta² = -1
    rim = 320 + 200 * math.sqrt(1 / 0.3) * 2 / 3
    seen = lens_rays(narrow, [(rim - 1e-6, 240, 0.5, 0.5), (rim + 1e-6, 240, 0.5, 0.5)])[1].any(axis=1)
    assert seen.tolist() == narrow.rays([(rim - 1e-6, 240), (rim + 1e-6, 240)])[1].any(axis=1).tolist() == [True, False]


@pytest.mark.peers
@pytest.mark.parametrize("lens", LENSES)
def test_points_are_seen_where_opencv_sees_them(lens):
    import cv2

    k = np.array([[500.0, 0, 310], [0, 480, 250], [0, 0, 1]])
    values = {name: 0.0 for name in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")} | LENSES[lens]
    model = values.pop("model", "brown_conrady")
    points = np.random.default_rng(4).uniform((-1, -1, 2), (1, 1, 3), (200, 3))
    if model == "kannala_brandt":
        dist = np.array([values[f"k{i}"] for i in range(1, 5)])
        expected, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), k, dist)
    else:
        dist = np.array(list(values.values()))
        expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), k, dist)
    camera = CalibratedCamera.from_opencv(k, dist, model=model)
    np.testing.assert_allclose(camera.project(points) - 0.5, expected[:, 0], rtol=0, atol=1e-9)


@pytest.mark.peers
def test_a_picture_of_a_chessboard_calibrates_to_the_camera_that_took_it():
    """Corners projected in twelve poses: OpenCV finds the numbers back."""
    import cv2

    camera = CalibratedCamera(fx=600, fy=590, cx=325, cy=235, k1=-0.2, k2=0.05, p1=1e-3, p2=-1e-3)
    board = np.array([(x, y, 0) for y in range(7) for x in range(9)], np.float64) * 0.05
    generator, seen = np.random.default_rng(5), []
    for _ in range(12):
        turn, _ = cv2.Rodrigues(generator.uniform(-0.4, 0.4, 3))
        place = generator.uniform((-0.25, -0.2, 0.6), (-0.15, -0.1, 0.8))
        seen.append(camera.project(board @ turn.T + place))
    objects, corners = [board.astype(np.float32)] * 12, [(s - 0.5).astype(np.float32) for s in seen]
    assert all(np.isfinite(s).all() for s in seen)
    error, k, dist, _, _ = cv2.calibrateCamera(objects, corners, (640, 480), None, None)
    found = CalibratedCamera.from_opencv(k, dist)
    assert error < 1e-3
    np.testing.assert_allclose(found.intrinsics(), camera.intrinsics(), atol=0.01)
    np.testing.assert_allclose(found.lens(), camera.lens(), atol=1e-3)


@pytest.mark.parametrize(("make", "message"), [
    (lambda: ThinLensCamera(lens_radius=1, f_number=2), r"ThinLensCamera\.f_number: given beside lens_radius"),
    (lambda: ThinLensCamera(blades=2), r"ThinLensCamera\.blades: got 2; allowed: 0 for a disk, or at least 3"),
    (lambda: ThinLensCamera(target=(0, 0, 5)), r"ThinLensCamera: eye and target are the same point"),
    (lambda: PanoramaCamera(projection="cylindrical", vfov=180), r"PanoramaCamera\.vfov: got 180 on a cylinder"),
    (lambda: PanoramaCamera(projection="cubic"), r"PanoramaCamera\.projection: unknown choice 'cubic'"),
    (lambda: FisheyeCamera(projection="orthographic", fov=200), r"FisheyeCamera\.fov: got 200; allowed: at most 180"),
    (lambda: CalibratedCamera(fx=1, model="kannala_brandt", p1=1), r"CalibratedCamera\.p1: given for kannala_brandt"),
    (lambda: CalibratedCamera.from_opencv(np.eye(3), [0] * 8 + [1]), r"dist: got .*allowed: k1 k2 p1 p2"),
    (lambda: CalibratedCamera.from_opencv(np.eye(4)), r"from_opencv: K: got"),
    (lambda: CalibratedCamera.from_opencv("K"), r"from_opencv: got no numbers"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()
