"""Whitted's integrator against closed forms: each term, each kind of ray, each switch."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr

SIZE = {"width": 32, "height": 24}
CAMERA = sr.PerspectiveCamera(eye=(0, 0, 5), vfov=40, **SIZE)


def picture(*objects, integrator=None, camera=CAMERA, **options):
    image = sr.render(sr.Scene(*objects, camera=camera, **options), integrator)
    return np.asarray(image).astype(np.float64)


def directions(camera):
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.stack([x, y], -1).reshape(-1, 2)
    return camera.rays(pixels)[1].reshape(camera.height, camera.width, 3)


WALL = sr.Plane(point=(0, 0, 0), normal=(0, 0, 1), material=sr.Lambert(albedo=0.6))


def test_inverse_square_and_lambert():
    """Radiance of a matte wall under a point light is albedo/pi * I cos(a) / r^2."""
    light = np.array([0.5, 1.0, 2.0])
    seen = picture(WALL, sr.PointLight(position=light, intensity=7))
    d = directions(CAMERA)
    p = np.array([0, 0, 5.0]) + d * (-5 / d[..., 2:3])
    to_light = light - p
    r = np.linalg.norm(to_light, axis=-1)
    expected = 0.6 / math.pi * 7 * (to_light[..., 2] / r) / r**2
    np.testing.assert_allclose(seen, expected[..., None] * np.ones(3), rtol=1e-6)


@pytest.mark.parametrize("highlight", ["phong", "blinn"])
def test_phong_terms(highlight):
    """Ambient, diffuse, highlight and emission of a sphere, computed once more in NumPy."""
    material = sr.Phong(diffuse=(0.3, 0.2, 0.1), specular=0.7, shininess=12, ambient=0.4, emission=(0, 0, 0.05),
                        highlight=highlight)  # fmt: skip
    light = sr.PointLight(position=(3, 2, 4), intensity=2, attenuation=(1, 0.1, 0.01))
    seen = picture(sr.Sphere(radius=1.5, material=material), light, ambient=(0.1, 0.2, 0.3))
    o, d = np.array([0, 0, 5.0]), directions(CAMERA)
    b = d @ o
    root = b * b - (o @ o - 1.5**2)
    hit = root > 0
    p = o + d * (-b - np.sqrt(np.where(hit, root, 0)))[..., None]
    n = p / 1.5
    l = np.array([3, 2, 4.0]) - p  # noqa: E741
    r = np.linalg.norm(l, axis=-1, keepdims=True)
    l = l / r  # noqa: E741
    n_l = (n * l).sum(-1)
    half = l - d
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    mirrored = 2 * n_l[..., None] * n - l
    cos_s = (n * half).sum(-1) if highlight == "blinn" else np.where(n_l > 0, -(mirrored * d).sum(-1), 0)
    arriving = 2 / (1 + 0.1 * r + 0.01 * r * r) * (n_l > 0)[..., None]  # the sphere shades its own back
    expected = (
        np.array([0.04, 0.08, 0.12])
        + (0, 0, 0.05)
        + arriving
        * (np.array([0.3, 0.2, 0.1]) * np.maximum(n_l, 0)[..., None] + 0.7 * np.maximum(cos_s, 0)[..., None] ** 12)
    )
    assert hit.sum() > 100
    np.testing.assert_allclose(seen[hit], expected[hit], rtol=2e-6, atol=1e-7)
    assert (seen[~hit] == 0).all()


def test_objects_beyond_a_point_light_cast_no_shadow():
    blocker = sr.Rectangle(corner=(-9, -9, 3), edge_u=(18, 0, 0), edge_v=(0, 18, 0))
    camera = sr.PerspectiveCamera(eye=(0, 0, 2.9), vfov=40, **SIZE)
    near, far = (picture(WALL, sr.PointLight(position=(0, 0, z), intensity=5), blocker, camera=camera) for z in (2, 4))
    assert near.min() > 0
    assert far.max() == 0
    assert (
        picture(
            WALL,
            sr.PointLight(position=(0, 0, 4), intensity=5),
            blocker,
            camera=camera,
            integrator=sr.Whitted(shadows=False),
        ).min()
        > 0
    )


def test_plane_mirror_is_the_method_of_images():
    """What is seen in a mirror equals what is seen of the mirror image without it."""
    camera = CAMERA.resized(96, 72)
    ball = sr.Sphere(center=(-1.1, 0.7, 1.2), radius=0.5, material=sr.Lambert(albedo=(0.8, 0.3, 0.2)))
    image = ball.replace(center=(-1.1, 0.7, -1.2))
    mirror = sr.Rectangle(corner=(-9, -9, 0), edge_u=(18, 0, 0), edge_v=(0, 18, 0), material=sr.Mirror())
    reflected = picture(ball, mirror, sr.PointLight(position=(2, 3, 2), intensity=30), camera=camera)
    direct = picture(image, sr.PointLight(position=(2, 3, -2), intensity=30), camera=camera)
    unhidden = (picture(ball, ambient=1.0, camera=camera) == 0).all(-1)  # the ball hides part of its mirror image
    assert (direct[unhidden] > 0).sum() > 100
    np.testing.assert_allclose(reflected[unhidden], direct[unhidden], rtol=1e-5, atol=1e-7)


def test_two_mirrors_and_depth():
    """Between facing mirrors of reflectance 1/2, depth n adds emission / 2^n."""
    lamp = sr.Lambert(albedo=0, emission=1.0)
    mirror = sr.Mirror(reflectance=0.5)
    scene = [
        sr.Rectangle(corner=(-9, -9, -1), edge_u=(18, 0, 0), edge_v=(0, 18, 0), material=mirror),
        sr.Sphere(center=(0, 0, 0), radius=20, material=lamp),
    ]
    camera = sr.PerspectiveCamera(eye=(0, 0, 3), vfov=30, **SIZE)
    for depth, value in ((0, 0.0), (1, 0.5), (3, 0.5)):
        assert picture(*scene, camera=camera, integrator=sr.Whitted(max_depth=depth)) == pytest.approx(value)
    facing = sr.Rectangle(corner=(-9, -9, 4), edge_u=(18, 0, 0), edge_v=(0, 18, 0), material=mirror)
    both = [scene[0].replace(material=sr.Phong(diffuse=0, ambient=0, specular=0, emission=1, mirror=0.5)), facing]
    for depth in range(4):  # 1 from the near mirror, then 1/4 each time the ray comes back to it
        expected = sum(0.25**k for k in range(depth // 2 + 1))
        seen = picture(*both, camera=camera, integrator=sr.Whitted(max_depth=depth, cutoff=0))
        assert seen == pytest.approx(expected, rel=1e-6)


def test_slab_of_glass_transmits_and_displaces_as_snell_and_fresnel_say():
    """Behind a slab, parallel rays go on in their direction, weakened by both faces."""
    slab = sr.Box(lower=(-50, -50, -1), upper=(50, 50, 1), material=sr.Glass(ior=1.5))
    checks = sr.Bitmap(image=np.array([[0.0, 1.0], [1.0, 0.0]]), filter="nearest", scale=0.5)  # with hard edges
    back = sr.Plane(point=(0, 0, -3), normal=(0, 0, 1), material=sr.Phong(diffuse=checks, ambient=checks))
    camera = sr.OrthographicCamera(eye=(3, 0, 5), target=(0, 0, 0), view_height=6, **SIZE)
    seen = picture(slab, back, camera=camera, ambient=1.0, integrator=sr.Whitted(reflections=False, max_depth=2))
    plain = picture(back, camera=camera, ambient=1.0)
    d = directions(camera)[0, 0]
    cos_i = -d[2]
    sin_i = math.sqrt(1 - cos_i**2)
    cos_t = math.sqrt(1 - (sin_i / 1.5) ** 2)
    r_s = ((cos_i - 1.5 * cos_t) / (cos_i + 1.5 * cos_t)) ** 2
    r_p = ((1.5 * cos_i - cos_t) / (1.5 * cos_i + cos_t)) ** 2
    transmitted = (1 - (r_s + r_p) / 2) ** 2
    assert np.unique(np.round(seen, 5)) == pytest.approx([0, transmitted], rel=1e-4)
    # Shift of the checks along x: thickness (tan i - tan t), against the camera moved by the same.
    shift = 2 * (sin_i / cos_i - (sin_i / 1.5) / cos_t)
    eye, target, along = np.array([3.0, 0, 5]), np.zeros(3), np.array([shift, 0, 0])
    moved = sr.OrthographicCamera(eye=eye + along, target=target + along, view_height=6, **SIZE)
    expected = picture(back, camera=moved, ambient=1.0) * transmitted
    assert (np.abs(seen - expected) > 1e-5).mean() < 0.01
    assert (np.abs(plain * transmitted - expected) > 1e-5).mean() > 0.05


def test_absorption_follows_the_path_in_glass():
    slab = sr.Box(lower=(-9, -9, -1), upper=(9, 9, 1), material=sr.Glass(ior=1.0, absorption=(0, 0.5, 2)))
    back = sr.Plane(point=(0, 0, -3), normal=(0, 0, 1), material=sr.Lambert(albedo=0, emission=1))
    camera = sr.OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), view_height=2, **SIZE)
    seen = picture(slab, back, camera=camera)
    np.testing.assert_allclose(seen, np.broadcast_to(np.exp([0, -1.0, -4.0]), seen.shape), rtol=1e-5)


def test_total_internal_reflection_keeps_all_light():
    """A ray inside glass beyond the critical angle finds everything in the mirrored direction."""
    glass = sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=sr.Glass(ior=1.5))
    below = sr.PerspectiveCamera(eye=(0, -1, 0), target=(3, 0, 0), vfov=4, **SIZE)  # 71 degrees, critical is 42
    lamp = sr.Sphere(center=(0, 0, 0), radius=50, material=sr.Lambert(albedo=0, emission=1))
    assert picture(glass, lamp, camera=below) == pytest.approx(1.0, rel=1e-6)
    floor = sr.Plane(point=(0, -2, 0), normal=(0, 1, 0), material=sr.Lambert(albedo=0, emission=3))
    assert picture(glass, floor, lamp, camera=below) == pytest.approx(3.0, rel=1e-6)


def test_glass_shadow_option():
    pane = sr.Rectangle(corner=(-9, -9, 1), edge_u=(18, 0, 0), edge_v=(0, 18, 0), material=sr.Glass(ior=1.0))
    camera = sr.PerspectiveCamera(eye=(0, 0, 0.9), vfov=40, **SIZE)
    light = sr.PointLight(position=(0, 0, 4), intensity=5)
    dark = picture(WALL, pane, light, camera=camera)
    lit = picture(WALL, pane, light, camera=camera, integrator=sr.Whitted(transparent_shadows=True))
    assert dark.max() == 0
    np.testing.assert_allclose(lit, picture(WALL, light, camera=camera), rtol=1e-6)


def test_contribution_cutoff_ends_recursion():
    mirrors = [
        sr.Rectangle(corner=(-9, -9, z), edge_u=(18, 0, 0), edge_v=(0, 18, 0), material=sr.Mirror(reflectance=0.1))
        for z in (-1, 4)
    ]
    camera = sr.PerspectiveCamera(eye=(0, 0, 3), vfov=30, **SIZE)
    scene = sr.Scene(*mirrors, camera=camera)
    for cutoff, rays in ((0.5, 1), (0.05, 2), (0.005, 3), (0.0, 6)):
        image = sr.render(scene, sr.Whitted(cutoff=cutoff, max_depth=5))
        assert image.info["rays"] == rays * 32 * 24


def test_area_light_casts_a_penumbra_that_converges():
    """Irradiance behind a half-plane edge grows linearly through the penumbra of a strip light seen edge on."""
    blocker = sr.Rectangle(corner=(-20, 2, -20), edge_u=(20, 0, 0), edge_v=(0, 0, 40))
    light = sr.RectangleLight(corner=(-0.5, 4, -0.5), edge_u=(1, 0, 0), edge_v=(0, 0, 1), radiance=10, grid=16,
                              visible=False)  # fmt: skip
    floor = sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=sr.Lambert(albedo=1))
    camera = sr.OrthographicCamera(
        eye=(0, 1.5, 0), target=(0, 0, 0), up=(0, 0, -1), view_height=1.0, width=65, height=3
    )
    scene = [floor, light.replace(two_sided=True)]
    open_sky = picture(*scene, camera=camera)[1, :, 0]
    share = picture(*scene, blocker, camera=camera)[1, :, 0] / open_sky
    x = (np.arange(65) + 0.5 - 32.5) / 65 * (65 / 3)
    inside = np.abs(x) < 0.45
    np.testing.assert_allclose(share[inside], 0.5 + x[inside], atol=0.04)
    assert (share[x < -0.55] == 0).all()
    np.testing.assert_allclose(share[x > 0.55], 1, atol=1e-9)


def test_two_sided_switch():
    back = sr.Rectangle(corner=(-9, -9, 0), edge_u=(0, 18, 0), edge_v=(18, 0, 0), material=sr.Lambert(albedo=0.5))
    light = sr.PointLight(position=(0, 0, 3), intensity=5)
    assert picture(back, light).min() > 0
    assert picture(back, light, integrator=sr.Whitted(two_sided=False)).max() == 0


def test_mirrored_instance_keeps_its_outside():
    ball = sr.Sphere(center=(1, 0, 0), radius=0.5, material=sr.Phong(diffuse=0.8, specular=0))
    flipped = sr.Instance(of=ball, transform=sr.Transform.scale(-1, 1, 1))
    light = sr.PointLight(position=(-3, 2, 4), intensity=20)
    plain = ball.replace(center=(-1, 0, 0))
    one_sided = sr.Whitted(two_sided=False)
    np.testing.assert_allclose(
        picture(flipped, light, integrator=one_sided), picture(plain, light, integrator=one_sided), rtol=1e-6, atol=1e-7
    )


def test_outlines_of_coarse_smooth_meshes_are_not_dark():
    """A bent sheet whose corner normals lean away from the viewer: lit from the viewer's side it must not turn black."""
    lean = np.array([0.9, 0, -0.43])  # away from the viewer at +z, although the sheet faces him
    sheet = sr.Mesh(
        vertices=[(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], faces=[(0, 1, 2), (0, 2, 3)],
        normals=[(0, 0, 1), lean, lean, (0, 0, 1)], material=sr.Lambert(albedo=0.8),
    )  # fmt: skip
    light = sr.DirectionalLight(direction=(-1, 0, -0.3), irradiance=2)
    camera = sr.OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), view_height=1.9, width=31, height=31)
    for integrator in (sr.Whitted(), sr.PathTracer(max_depth=1)):
        row = picture(sheet, light, camera=camera, integrator=integrator)[15, :, 0]
        assert (np.diff(row) > -0.02).all()  # brighter and brighter towards the light
        assert row[-1] > 0.4
