"""The measuring tasks: shadow areas and sub-pixel reconstruction, against closed forms and differences of renders."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from label_scenes import CRATE, POSE, SIZE, centres, every_camera

import sightray as sr
from sightray.vision import back_project, shadow_mask

FLOOR = sr.Plane(point=(0, 0, 0), normal=(0, 1, 0))
BALL = sr.Sphere(center=(0.3, 1.2, -0.2), radius=0.5)
BOX = sr.Box(lower=(-1.6, 0, -0.4), upper=(-0.8, 0.9, 0.5))
ABOVE = sr.PerspectiveCamera(eye=(0, 9, 0.01), target=(0, 0, 0), up=(0, 0, -1), vfov=36, width=160, height=120)
ASIDE = sr.PerspectiveCamera(eye=(-2.5, 2.4, 4.6), target=(0, 0.5, 0), vfov=34, width=200, height=150)
LAMP = sr.PointLight(position=(1.4, 4.0, 1.1))


def fibonacci(n: int) -> np.ndarray:
    """Points spread evenly over the unit sphere, (n, 3)."""
    k = np.arange(n) + 0.5
    y, turn = 1 - 2 * k / n, np.pi * (1 + 5**0.5) * k
    return np.stack([np.sqrt(1 - y * y) * np.cos(turn), y, np.sqrt(1 - y * y) * np.sin(turn)], axis=-1)


def cloud(n: int, center=(0.0, 0.0, 0.0), radius: float = 1.0) -> sr.PointCloud:
    """Measured points of a sphere, with its normals."""
    unit = fibonacci(n)
    return sr.PointCloud(points=center + radius * unit, normals=unit)


# -------------------------------------------------------------------------------------------------------- shadow areas


@pytest.mark.parametrize(
    "light", [LAMP, sr.DirectionalLight(direction=(-0.5, -1, -0.3)), sr.SpotLight(position=(1, 5, 1), target=(0, 0, 0))]
)
def test_the_mask_is_the_difference_of_renders_with_the_light_on_and_off(light):
    things = (FLOOR, BALL, BOX, CRATE)
    found = shadow_mask(things, ASIDE, light)
    on, off = (np.asarray(sr.render(sr.Scene(*things, *lights, camera=ASIDE, ambient=0.1), integrator=sr.Whitted(),
                                    samples=1).pixels) for lights in ((light,), ()))  # fmt: skip
    gained = (on - off).max(axis=-1)
    shines = ~found.background
    if isinstance(light, sr.SpotLight):  # outside of its cone it brings nothing, though only geometry is asked
        bare = sr.render(sr.Scene(*things, light, camera=ASIDE, ambient=0.1), integrator=sr.Whitted(shadows=False),
                         samples=1)  # fmt: skip
        shines &= (np.asarray(bare.pixels) - off).max(axis=-1) > 1e-7
        shines |= found.attached
    assert shines.sum() > 3000
    assert (found.attached & shines).sum() > 100
    assert (found.cast & shines).sum() > 100
    lit = found.visible_fraction == 1
    assert ((gained > 1e-7) == lit)[shines].all()
    assert not (found.attached & found.cast).any()
    assert (lit | found.attached | found.cast | found.background).all()
    assert np.isnan(found.visible_fraction[found.background]).all()


@pytest.mark.parametrize("position", [(0.3, 4.0, -0.2), (1.6, 3.4, 0.7)])
def test_the_shadow_of_a_sphere_is_the_conic_of_similar_triangles(position):
    """A cone of sin a = r / |c - l| around the ball; straight below the light a circle of radius height tan(a)."""
    found = shadow_mask([FLOOR, BALL], ABOVE, sr.PointLight(position=position))
    seen = back_project(centres(ABOVE), ABOVE, [FLOOR, BALL])
    floor = seen.shape == 0
    axis = np.subtract(BALL.center, position)
    reach = np.linalg.norm(axis)
    angle = np.arcsin(BALL.radius / reach)
    to = seen.points - position
    dark = (to @ axis) / (np.linalg.norm(to, axis=-1) * reach) > np.cos(angle)
    if position[0] == BALL.center[0]:
        radius = position[1] * np.tan(angle)
        from_middle = np.hypot(seen.points[..., 0] - position[0], seen.points[..., 2] - position[2])
        assert (dark == (from_middle < radius))[floor].all()
    assert (dark & floor).sum() > 100
    assert (found.umbra == dark)[floor].all()
    assert (found.cast == dark)[floor].all()
    facing = (seen.normal * (position - seen.points)).sum(-1) > 0
    assert (found.attached == ~facing)[seen.shape == 1].all()


def test_the_penumbra_of_an_edge_under_a_rectangle_light_is_linear():
    """A half-plane x < 0 at a third of the light's height: the fraction rises over a width of 2 w h / (H - h)."""
    high, low, half = 30.0, 10.0, 0.6
    lamp = sr.RectangleLight(corner=(-half, high, -half), edge_u=(2 * half, 0, 0), edge_v=(0, 0, 2 * half), grid=4)
    roof = sr.Rectangle(corner=(-400, low, -400), edge_u=(400, 0, 0), edge_v=(0, 0, 800))
    camera = sr.PerspectiveCamera(eye=(2.0, 3, 0), target=(0, 0, 0), up=(0, 0, 1), vfov=3, width=160, height=12)
    found = shadow_mask([FLOOR, roof], camera, lamp, rays=16)
    x = back_project(centres(camera), camera, FLOOR).points[..., 0]
    expected = np.clip(0.5 + x * (high - low) / low / (2 * half), 0, 1)
    assert found.penumbra.sum() > 300
    assert found.umbra.sum() > 100
    assert (found.visible_fraction == 1).sum() > 100
    # half a step of the 64 rows of rays, and what the light's near edge counts more: half its angle's change
    assert np.abs(found.visible_fraction - expected).max() <= 0.5 / 64 + 0.002
    assert (found.cast == (expected < 1))[np.abs(expected - 1) > 0.02].all()
    assert not found.attached.any()


def test_the_penumbra_fraction_is_the_share_of_light_that_renders_keep():
    lamp = sr.DiskLight(center=(1.4, 5, 1.1), normal=(0, -1, 0), radius=0.7, grid=16)
    found = shadow_mask([FLOOR, BALL], ABOVE, lamp, rays=2)
    kept, whole = (np.asarray(sr.render(sr.Scene(FLOOR, BALL, lamp, camera=ABOVE), samples=1,
                                        integrator=sr.Whitted(shadows=shadows)).pixels)[..., 0]
                   for shadows in (True, False))  # fmt: skip
    floor = back_project(centres(ABOVE), ABOVE, [FLOOR, BALL, lamp.shape()]).shape == 0
    share = kept[floor] / whole[floor]
    assert (found.penumbra & floor).sum() > 200
    assert np.abs(found.visible_fraction[floor] - share).max() <= 0.05
    assert abs((found.visible_fraction[floor] - share).mean()) <= 5e-4


def test_a_cloud_and_a_mesh_of_the_same_sphere_have_the_same_shadow_but_for_its_border():
    ball = trimesh.creation.icosphere(subdivisions=5, radius=BALL.radius)
    mesh = sr.Mesh(vertices=ball.vertices + BALL.center, faces=ball.faces)
    masks = [shadow_mask([FLOOR, thing], ASIDE, LAMP) for thing in (BALL, mesh, cloud(4000, BALL.center, BALL.radius))]
    kinds = [1 * mask.attached + 2 * mask.cast + 4 * mask.background for mask in masks]
    border = np.zeros(kinds[0].shape, bool)
    shown = back_project(centres(ASIDE), ASIDE, [FLOOR, BALL]).shape
    for shift in np.ndindex(3, 3):
        by = (shift[0] - 1, shift[1] - 1)
        border |= (np.roll(kinds[0], by, (0, 1)) != kinds[0]) | (np.roll(shown, by, (0, 1)) != shown)
    for kind in range(3):
        assert (kinds[0] == kind)[~border].sum() > 100
    assert border.sum() < 1000
    for other in kinds[1:]:
        assert (other == kinds[0])[~border].all()


def test_lights_of_a_scene_do_not_count_and_the_light_itself_is_background():
    lamp = sr.RectangleLight(corner=(-0.5, 3, -0.5), edge_u=(1, 0, 0), edge_v=(0, 0, 1), radiance=0)
    shade = sr.SphereLight(center=(0, 1.5, 0), radius=0.9)
    alone = shadow_mask([FLOOR, BALL], ABOVE, lamp)
    within = shadow_mask(sr.Scene(shade, FLOOR, BALL, camera=ASIDE), ABOVE, lamp)
    bright = shadow_mask([FLOOR, BALL], ABOVE, lamp.replace(radiance=7))
    assert np.array_equal(alone.visible_fraction, within.visible_fraction, equal_nan=True)
    assert np.abs(alone.visible_fraction - bright.visible_fraction)[~alone.background].max() < 0.1
    o, d = ABOVE.rays(centres(ABOVE))
    p = o + d * ((3 - o[..., 1]) / d[..., 1])[..., None]
    assert (alone.background == (np.abs(p[..., [0, 2]]) < 0.5).all(-1)).all()
    assert alone.background.sum() > 100


# -------------------------------------------------------------------------------------------- sub-pixel reconstruction


def projecting_cameras() -> dict[str, sr.PerspectiveCamera]:
    """One of each registered kind, and the kinds of lenses beside."""
    lens = {**SIZE, "fx": 38.0, "fy": 37.0, "cx": 20.1, "cy": 15.7, "pose": POSE}
    found = dict(every_camera())
    found["brown_conrady"] = sr.CalibratedCamera(**lens, skew=0.3, k1=-0.28, k2=0.09, k3=-0.01, p1=2e-3, p2=-1e-3)
    found["rational"] = sr.CalibratedCamera(**lens, k1=0.3, k2=0.1, k3=0.01, k4=0.35, k5=0.15, k6=0.02)
    found["kannala_brandt"] = sr.CalibratedCamera(**lens, model="kannala_brandt", k1=-0.03, k2=0.01, k3=-2e-3, k4=1e-4)
    for projection in ("equisolid", "stereographic", "orthographic"):
        found[projection] = found["FisheyeCamera"].replace(projection=projection, fov=140)
    found["cylindrical"] = found["PanoramaCamera"].replace(projection="cylindrical")
    later = POSE.copy()
    later[:3, 3] += (0.3, -0.1, 0.05)
    found["rolling"] = sr.MovingCamera(camera=sr.PerspectiveCamera(**SIZE, readout=0.5), poses=[(0.0, POSE), (1.0, later)])
    return found


@pytest.mark.parametrize("name", sorted(projecting_cameras()))
def test_projection_and_back_projection_invert(name):
    camera = projecting_cameras()[name]
    pixels = np.random.default_rng(5).uniform((-3, -3), (camera.width + 3, camera.height + 3), (80, 100, 2))
    ball = sr.Sphere(center=(0.2, 0.6, 0.3), radius=0.8)
    found = back_project(pixels, camera, [FLOOR, ball, CRATE])
    assert found.points.shape == (80, 100, 3)
    for shape in (1, 2):
        assert (found.shape == shape).sum() > 10
    error = np.abs(camera.project(found.points) - pixels)
    assert np.isnan(error[~found.met]).all()
    assert error[found.met].max() <= 1e-9
    origins, _ = camera.rays(pixels)
    away = np.linalg.norm(found.points - origins, axis=-1)
    assert np.abs(away - found.distance)[found.met].max() <= 1e-10
    assert np.isinf(found.distance[~found.met]).all()
    on = found.shape == 1
    unit = (found.points[on] - ball.center) / ball.radius
    assert np.abs(np.linalg.norm(unit, axis=-1) - 1).max() <= 1e-12
    assert np.abs(found.normal[on] - unit).max() <= 1e-10


def test_points_lie_on_the_triangle_that_is_named():
    ball = trimesh.creation.icosphere(subdivisions=3)
    vertices, triangles = np.array(ball.vertices), np.array(ball.faces)
    mesh = sr.Mesh(vertices=vertices, faces=triangles)
    camera = sr.CalibratedCamera(width=90, height=70, fx=80, k1=-0.2, k2=0.05,
                                 pose=[(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, -3), (0, 0, 0, 1)])  # fmt: skip
    pixels = np.random.default_rng(6).uniform((0, 0), (90, 70), (3000, 2))
    found = back_project(pixels, camera, mesh)
    faces = triangles[found.primitive[found.met]]
    weights = trimesh.triangles.points_to_barycentric(vertices[faces], found.points[found.met])
    assert found.met.sum() > 1000
    assert weights.min() >= -1e-12
    normals = np.cross(*(vertices[faces[:, k]] - vertices[faces[:, 0]] for k in (1, 2)))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    assert np.abs(((vertices[faces[:, 0]] - found.points[found.met]) * normals).sum(-1)).max() <= 1e-14
    assert np.abs(found.normal[found.met] - normals).max() <= 1e-12


def test_the_error_on_a_cloud_falls_with_the_square_of_the_spacing():
    """Four times the points are half the spacing: a quarter of the distance to the sphere that was measured."""
    camera = sr.PerspectiveCamera(eye=(0.3, 0.4, 4), target=(0, 0, 0), vfov=24, width=90, height=90)
    pixels = np.random.default_rng(7).uniform((15, 15), (75, 75), (2000, 2))
    true = back_project(pixels, camera, sr.Sphere(radius=1))
    rms = []
    for n in (1000, 4000, 16000):
        points = cloud(n)
        found = back_project(pixels, camera, points)
        assert found.met.all()
        assert np.abs(camera.project(found.points) - pixels).max() <= 1e-9
        rms.append(np.sqrt(((found.points - true.points) ** 2).sum(-1).mean()))
        near = np.linalg.norm(points.points[found.primitive] - found.points, axis=-1)
        assert near.max() <= 2 * np.sqrt(4 * np.pi / n)
    assert rms[0] < 0.02
    assert rms[0] / rms[1] == pytest.approx(4, rel=0.15)
    assert rms[1] / rms[2] == pytest.approx(4, rel=0.15)


def test_what_is_no_pixel_meets_nothing_and_what_moves_is_met_in_the_middle_of_the_exposure():
    camera = sr.PerspectiveCamera(eye=(0, 0, 5), target=(0, 0, 0), width=9, height=9, shutter_open=1, shutter_close=3)
    moving = sr.Group(objects=[sr.Sphere(radius=1)], motion=[(0, np.eye(4)), (4, sr.Transform.translate(0, 0, -8).matrix)])
    found = back_project([(4.5, 4.5), (np.nan, 4.5), (-500, 4.5)], camera, moving)
    assert found.distance[0] == pytest.approx(8, abs=1e-12)
    assert found.met.tolist() == [True, False, False]
    assert found.primitive.tolist()[1:] == found.shape.tolist()[1:] == [-1, -1]
    assert np.isnan(found.points[1:]).all()
    assert np.isnan(found.normal[1:]).all()
    circle = sr.FisheyeCamera(eye=(0, 0, 5), target=(0, 0, 0), width=40, height=40)
    assert not back_project((0.5, 0.5), circle, sr.Sphere(center=(0, 0, 5), radius=9)).met
    assert back_project((20, 20), circle, sr.Sphere(center=(0, 0, 5), radius=9)).met


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: back_project([(1, 2)], None, BALL), "back_project: camera: got None"),
        (lambda: back_project([(1, 2, 3)], ABOVE, BALL), "back_project: pixels: got an array of shape"),
        (lambda: back_project([(1, 2)], ABOVE, "ball"), "back_project: geometry: got 'ball'"),
        (lambda: back_project([(1, 2)], ABOVE, [LAMP]), "back_project: geometry"),
        (lambda: back_project([(1, 2)], ABOVE, sr.Scene(LAMP)), "back_project: geometry: got no shapes"),
        (lambda: back_project([(1, 2)], ABOVE, BALL, threads=0), "threads: got 0"),
        (lambda: shadow_mask(BALL, ABOVE, BALL), "shadow_mask: light: got"),
        (lambda: shadow_mask([], ABOVE, LAMP), "shadow_mask: geometry: got no shapes"),
        (lambda: shadow_mask(BALL, "above", LAMP), "shadow_mask: camera: got 'above'"),
        (lambda: shadow_mask(BALL, ABOVE, LAMP, rays=0), "rays: got 0"),
    ],
)
def test_bad_arguments_are_named(call, message):
    with pytest.raises(sr.SceneError, match=message):
        call()
