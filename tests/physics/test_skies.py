"""Light from infinitely far away, against integrals, formulas and published numbers; and where pictures look."""

from __future__ import annotations

import datetime
import math

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel, native
from sightray.errors import SceneError
from sightray.lights import daylight
from sightray.lights.base import cells, illuminate, sky
from sightray.lights.environment import EnvironmentLight
from sightray.lights.projector import ProjectorLight
from sightray.lights.sunsky import SunSky
from sightray.mathlib.rng import uniform
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, vec3_at, vec3_put
from sightray.mathlib.transform import Transform
from sightray.mathlib.vec import Vec3, dot, grey
from sightray.scene.compile import Tables


@kernel
def look(light: Table, count: i64, directions: Table, colors: Table) -> i64:
    """Radiance in many directions."""
    for i in range(count):
        vec3_put(colors, 4 * i, sky(light, vec3_at(directions, 4 * i)))
    return count


@kernel
def gather(light: Table, normal: Table, trials: i64, out: Table) -> i64:
    """Irradiance, RGB, of a surface: one estimate a trial, over all cells."""
    n = vec3_at(normal, 0)
    count = cells(light)
    for trial in range(trials):
        total = grey(0.0)
        for cell in range(count):
            sample = illuminate(light, Vec3(1.0, 2.0, 3.0), cell, uniform(trial, 2 * cell), uniform(trial, 2 * cell + 1))
            total += sample.irradiance * max(0.0, dot(n, sample.direction))
        vec3_put(out, 4 * trial, total)
    return count


def seen(light, directions) -> np.ndarray:
    """Radiance, (n, 3), in directions, (n, 3)."""
    d = np.zeros((len(directions), 4))
    d[:, :3] = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    tables, out = Tables(), np.zeros((len(d), 4))
    row = tables.row_of(light)
    tables.prepare(look)
    native(look)(row, len(d), Table(d), Table(out))
    return out[:, :3]


def irradiance(light, normal, trials: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard error, (3,) each."""
    n = np.zeros(4)
    n[:3] = normal / np.linalg.norm(normal)
    tables, out = Tables(), np.zeros((trials, 4))
    row = tables.row_of(light)
    tables.prepare(gather)
    native(gather)(row, Table(n), trials, Table(out))
    return out[:, :3].mean(axis=0), out[:, :3].std(axis=0, ddof=1) / math.sqrt(trials)


def integrated(light, normal, rows: int = 900) -> np.ndarray:
    """Irradiance by the midpoint rule over the sphere, (3,)."""
    theta = (np.arange(rows) + 0.5) * math.pi / rows
    phi = (np.arange(2 * rows) + 0.5) * math.pi / rows
    sine, cosine = np.sin(theta)[:, None], np.cos(theta)[:, None]
    d = np.stack(np.broadcast_arrays(sine * np.cos(phi), cosine, sine * np.sin(phi)), axis=-1)
    facing = np.maximum(d @ (np.array(normal) / np.linalg.norm(normal)), 0.0)
    weight = (sine * facing * (math.pi / rows) ** 2).ravel()
    return weight @ seen(light, d.reshape(-1, 3))


def random_picture(h: int, w: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    picture = rng.uniform(0, 1, (h, w, 3)) ** 6
    picture[h // 3, w // 4] = (90, 50, 20)
    picture[:, w // 2 : w // 2 + w // 4] = 0
    return picture


# --- environments --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("normal", [(0, 1, 0), (1, 0, 0), (-1, -2, 3)])
def test_a_constant_environment_brings_pi_times_its_radiance(normal):
    mean, error = irradiance(EnvironmentLight(radiance=(1, 2, 0.25)), normal)
    assert (np.abs(mean - math.pi * np.array([1, 2, 0.25])) < 4 * error).all()
    assert (error < 0.01 * mean).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 1), (6, 11), (32, 64)])
@pytest.mark.parametrize("normal", [(0, 1, 0), (-1, -0.3, 2)])
def test_a_picture_brings_what_the_integral_over_it_says(shape, normal):
    light = EnvironmentLight(image=random_picture(*shape), transform=Transform.rotate((1, 1, 0), 50))
    expected = integrated(light, normal)
    mean, error = irradiance(light, normal)
    assert (np.abs(mean - expected) < 4 * error + 2e-4 * expected).all()
    assert (error < 0.03 * expected).all()


def test_the_middle_column_looks_along_minus_z_and_columns_turn_to_plus_x():
    h, w = 8, 16
    picture = np.zeros((h, w, 3))
    picture[:, :, 0], picture[:, :, 1] = np.arange(w) + 0.5, (np.arange(h) + 0.5)[:, None]
    light = EnvironmentLight(image=picture)
    ways = {(0, 0, -1): (8, 4), (1, 0, -1): (10, 4), (1, 0, 0): (12, 4), (1, 0, 1): (14, 4), (-1, 0, 0): (4, 4),
            (-1, 0, 1): (2, 4), (0, 1, -1): (8, 2), (1, -math.sqrt(2), 1): (14, 6)}  # fmt: skip
    found = seen(light, np.array(list(ways), float))
    np.testing.assert_allclose(found[:, :2], list(ways.values()), atol=1e-6)
    assert seen(light, np.array([(0, 1, 0), (0, -1, 0)]))[:, 1].tolist() == [0.5, 7.5]

    # A camera that looks along -z has the picture before it the right way round.
    camera = sr.PerspectiveCamera(eye=(0, 0, 0), target=(0, 0, -1), vfov=90, width=32, height=32)
    image = np.asarray(sr.render(sr.Scene(sr.Sphere(center=(0, 0, 99)), light, camera=camera), sr.Whitted(), samples=1))
    assert (np.diff(image[16, :, 0]) > 0).all()
    assert (np.diff(image[:, 16, 1]) > 0).all()


def test_the_transform_turns_the_picture():
    picture = random_picture(20, 40)
    ways = np.random.default_rng(1).normal(size=(50, 3))
    turn = Transform.rotate((0, 1, 0), 90)
    light = EnvironmentLight(image=picture)
    np.testing.assert_allclose(turn.direction([(0, 0, -1)]), [(-1, 0, 0)], atol=1e-15)
    expected = seen(light, ways)
    np.testing.assert_allclose(seen(light.replace(transform=turn), turn.direction(ways)), expected, rtol=1e-6, atol=1e-9)
    moved = Transform.translate(5, 6, 7) @ turn
    np.testing.assert_allclose(seen(light.replace(transform=moved), turn.direction(ways)), expected, rtol=1e-6, atol=1e-9)


def test_neighbours_blend_across_the_seam():
    picture = np.zeros((4, 8, 3))
    picture[:, 0], picture[:, -1] = 1, 3
    back = EnvironmentLight(image=picture)
    assert seen(back, np.array([(0, 0, 1.0)]))[0] == pytest.approx([2, 2, 2])


def test_a_black_environment_is_black():
    light = EnvironmentLight(image=np.zeros((3, 5, 3)))
    mean, error = irradiance(light, (0, 1, 0), 20)
    assert not mean.any()
    assert not error.any()


def test_negative_pixels_count_as_black_and_undefined_ones_are_refused(tmp_path):
    picture = random_picture(4, 6)
    picture[1, 1] = -3
    assert (EnvironmentLight(image=picture).pixels >= 0).all()
    picture[2, 2] = np.nan
    with pytest.raises(SceneError, match=r"EnvironmentLight\.image: the array holds infinite or undefined"):
        EnvironmentLight(image=picture)
    with pytest.raises(SceneError, match="no such file"):
        EnvironmentLight(image=tmp_path / "none.hdr")
    with pytest.raises(SceneError, match=r"EnvironmentLight\.transform: .*rotation"):
        EnvironmentLight(transform=Transform.scale(2))


@pytest.mark.parametrize("suffix", [".exr", ".hdr", ".npy"])
def test_environments_come_from_files_also_in_yaml(tmp_path, suffix):
    picture = random_picture(6, 12).astype(np.float32)
    sr.Image(picture).save(tmp_path / f"sky{suffix}")
    (tmp_path / "s.yaml").write_text(f"objects:\n- {{type: EnvironmentLight, image: sky{suffix}}}\n- {{type: Sphere}}\n")
    (light,) = sr.load(tmp_path / "s.yaml").lights
    np.testing.assert_allclose(light.pixels, picture, rtol=0, atol=0.4 if suffix == ".hdr" else 0)
    sr.save(sr.Scene(light, EnvironmentLight(image=picture)), tmp_path / "again.yaml")
    again = sr.load(tmp_path / "again.yaml").lights
    assert (again[0].pixels == light.pixels).all()
    assert (again[1].pixels == picture).all()


# --- sun and sky ---------------------------------------------------------------------------------------------------

DAYS = [(elevation, turbidity) for elevation in (3, 20, 45, 80) for turbidity in (2, 4, 9)]


def day(elevation: float, turbidity: float, **fields) -> SunSky:
    e = math.radians(elevation)
    return SunSky(direction=(math.cos(e) * 0.6, math.sin(e), math.cos(e) * -0.8), turbidity=turbidity, **fields)


@pytest.mark.parametrize(("elevation", "turbidity"), DAYS)
def test_the_kernel_gives_preethams_sky(elevation, turbidity):
    light = day(elevation, turbidity, sun_scale=0, scale=(1, 2, 3))
    d = np.random.default_rng(0).normal(size=(500, 3))
    d[:, 1] = np.abs(d[:, 1])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    expected = daylight.sky_brightness(light.perez(), light.to_sun(), d) * (1, 2, 3)
    np.testing.assert_allclose(seen(light, d), expected, rtol=1e-9, atol=1e-9)
    assert (expected.max(axis=1) > 0).all()


def test_preethams_formula_at_the_zenith():
    """Luminance and chromaticity at the zenith, computed by hand from the appendix for turbidity 2 and a sun at 60°."""
    sky = daylight.preetham(2.0, math.radians(60))
    chi = (4 / 9 - 2 / 120) * (math.pi - 2 * math.radians(60))
    luminance, x, y = sky.at(np.array(1.0), np.array(math.radians(60)))
    assert luminance == pytest.approx((4.0453 * 2 - 4.9710) * math.tan(chi) - 0.2155 * 2 + 2.4192, rel=1e-12)
    t = math.radians(60)
    rows_x = (0.00166 * t**3 - 0.00375 * t**2 + 0.00209 * t, -0.02903 * t**3 + 0.06377 * t**2 - 0.03202 * t + 0.00394,
              0.11693 * t**3 - 0.21196 * t**2 + 0.06052 * t + 0.25886)  # fmt: skip
    assert x == pytest.approx(4 * rows_x[0] + 2 * rows_x[1] + rows_x[2], rel=1e-12)
    assert 0.23 < x < 0.27  # deep blue
    assert 0.24 < y < 0.28


@pytest.mark.parametrize(("elevation", "turbidity"), DAYS)
def test_sun_and_sky_bring_what_is_said(elevation, turbidity):
    """A level floor, by sampling sky and disc, against the table's sums and the disc's solid angle times the sine."""
    light = day(elevation, turbidity, ground=0)
    sun, from_sky = light.ground_irradiance()
    mean, error = irradiance(light, (0, 1, 0))
    assert (np.abs(mean - sun - from_sky) < 4 * error + 2e-3 * (sun + from_sky)).all()
    assert (error < 0.01 * mean).all()

    # Another size of the disc keeps what it brings.
    broad, error = irradiance(light.replace(sun_radius=2), (0, 1, 0))
    assert (np.abs(broad - mean) < 5 * error + (0.02 if elevation == 3 else 2e-3) * mean).all()


def test_the_ground_reflects_its_albedo():
    light = day(40, 3, ground=(0.5, 0.2, 0))
    expected = np.sum(light.ground_irradiance(), axis=0) * (0.5, 0.2, 0) / math.pi
    np.testing.assert_allclose(seen(light, np.array([(0.3, -1, 0.2), (1, -0.01, 0)])), [expected] * 2, rtol=1e-12)


def test_clear_noon_is_as_bright_as_it_is():
    """Direct sun about 100 klx, sky 10 to 40 klx (Preetham et al. 1999; IES Handbook), reddened by low sun and haze."""
    light = day(70, 2.5)
    sun, from_sky = (part @ (0.2126, 0.7152, 0.0722) * daylight.EFFICACY for part in light.ground_irradiance())
    assert 80e3 < sun < 110e3
    assert 10e3 < from_sky < 40e3
    (red, _, blue), (low_red, _, low_blue) = light.sun_radiance(), day(5, 2.5).sun_radiance()
    assert red / blue < 2 < low_red / low_blue
    assert (np.diff([day(40, t).sun_radiance()[1] for t in (2, 4, 6, 8)]) < 0).all()


def test_the_disc_has_the_suns_size():
    light = day(50, 3)
    sun, across = light.to_sun(), np.array([0.8, 0, 0.6])
    for degrees, inside in ((0.26, True), (0.27, False)):
        a = math.radians(degrees)
        d = sun * math.cos(a) + across * math.sin(a)
        assert (seen(light, d[None])[0].max() > 1e5) == inside


@pytest.mark.parametrize(("when", "place", "zenith", "azimuth"), [
    # I. Reda, A. Andreas, NREL/TP-560-34302, 2008, table A4.1: topocentric, without refraction.
    ("2003-10-17T12:30:30-07:00", (39.742476, -105.1786), 90 - 39.872046, 194.340241),
    # The sun stands over a tropic at its solstice, and over the equator at an equinox, at solar noon.
    ("2024-06-20T12:01:50Z", (23.4364, 0.0), 0.0, None),  # the equation of time: -1 min 50 s
    ("2024-03-20T12:07:24Z", (0.0, 0.0), 0.14, None),
])  # fmt: skip
def test_where_the_sun_stands(when, place, zenith, azimuth):
    east, up, south = SunSky(time=when, latitude=place[0], longitude=place[1]).to_sun()
    assert math.hypot(east, up, south) == pytest.approx(1)
    assert math.degrees(math.acos(min(up, 1.0))) == pytest.approx(zenith, abs=0.04 if azimuth is None else 0.02)
    if azimuth is not None:
        assert math.degrees(math.atan2(east, -south)) % 360 == pytest.approx(azimuth, abs=0.02)


def test_a_time_without_zone_is_universal_and_others_are_converted():
    at = {"latitude": 50.0, "longitude": 10.0}
    noon = SunSky(time="2024-05-01T11:00", **at).to_sun()
    np.testing.assert_array_equal(SunSky(time="2024-05-01T13:00+02:00", **at).to_sun(), noon)
    naive = daylight.sun_direction(datetime.datetime(2024, 5, 1, 11), 50.0, 10.0)
    np.testing.assert_array_equal(naive, noon)


@pytest.mark.parametrize(("fields", "message"), [
    ({"direction": (1, -0.1, 0)}, r"SunSky: the sun in direction .* is below the horizon; allowed: above it"),
    ({"time": "2024-06-21T23:30", "latitude": 40}, "SunSky: the sun at 2024-06-21T23:30 is below the horizon"),
    ({"time": "noon"}, r"SunSky\.time: got 'noon'; allowed: as 2024-06-21"),
    ({"turbidity": 1}, r"SunSky\.turbidity: got 1; allowed: .*>= 2 and <= 10"),
])  # fmt: skip
def test_errors_of_sun_and_sky(fields, message):
    with pytest.raises(SceneError, match=message):
        SunSky(**fields)


# --- projectors ----------------------------------------------------------------------------------------------------

POSE = {"eye": (1, 2, 6), "target": (0.5, 0.2, 0), "up": (0.2, 1, 0), "vfov": 35}


@kernel
def lit(light: Table, count: i64, points: Table, out: Table) -> i64:
    """Irradiance at many points, facing the light."""
    for i in range(count):
        vec3_put(out, 4 * i, illuminate(light, vec3_at(points, 4 * i), 0, 0.5, 0.5).irradiance)
    return count


def brought(light, points) -> np.ndarray:
    p, out = np.zeros((len(points), 4)), np.zeros((len(points), 4))
    p[:, :3] = points
    tables = Tables()
    row = tables.row_of(light)
    tables.prepare(lit)
    native(lit)(row, len(p), Table(p), Table(out))
    return out[:, :3]


def test_a_projectors_pixel_is_the_pixel_that_a_camera_in_its_place_sees():
    picture = np.random.default_rng(2).uniform(0, 1, (30, 40, 3)).astype(np.float32)
    light = ProjectorLight(image=picture, intensity=(2, 3, 4), filter="nearest", **POSE)
    camera = sr.PerspectiveCamera(width=40, height=30, **POSE)
    points = np.random.default_rng(3).uniform(-3, 3, (500, 3))
    pixel = camera.project(points)
    np.testing.assert_allclose(light.project(points), pixel, rtol=1e-12)
    inside = ((pixel >= 0) & (pixel < (40, 30))).all(axis=1)
    assert 50 < inside.sum() < 450
    x, y = np.floor(np.where(inside[:, None], pixel, 0)).astype(int).T
    r2 = ((points - light.eye) ** 2).sum(axis=1, keepdims=True)
    expected = np.where(inside[:, None], picture[y, x] * (2, 3, 4) / r2, 0)
    np.testing.assert_allclose(brought(light, points), expected, rtol=1e-12)

    # And the way back: rays of that camera through pixel centres end where just these pixels fall.
    centres = np.stack(np.meshgrid(np.arange(40) + 0.5, np.arange(30) + 0.5), axis=-1)
    o, d = camera.rays(centres)
    found = brought(light, (o + 7 * d).reshape(-1, 3)).reshape(30, 40, 3)
    np.testing.assert_allclose(found * 49, picture * (2, 3, 4), rtol=1e-12)
    smooth = brought(light.replace(filter="bilinear"), (o + 7 * d).reshape(-1, 3)).reshape(30, 40, 3)
    np.testing.assert_allclose(smooth * 49, picture * (2, 3, 4), rtol=1e-9)


def test_between_pixel_centres_a_bilinear_projector_blends():
    light = ProjectorLight(image=np.array([[[1.0], [3.0]]]), eye=(0, 0, 1), target=(0, 0, 0), vfov=90)
    x = np.array([-1, -0.75, -0.25, 0.0, 0.25, 0.75, 1])  # pixels are 2 m wide at a distance of 1 m; centres at -+1
    found = brought(light, np.stack([x, 0 * x, 0 * x], axis=1))[:, 0] * (1 + x * x)
    np.testing.assert_allclose(found, 2 + x, rtol=1e-12)


def test_a_picture_on_the_wall_is_seen_by_the_camera_in_its_place():
    """What is projected onto a facing wall comes back to a camera in the same place, times cos^3 of the angle."""
    picture = np.zeros((12, 16, 3), np.float32)
    picture[3:5, 2:9], picture[8, 11] = (1, 0.5, 0), (0, 0, 2)
    pose = {"eye": (0, 1, 4), "target": (0, 1, 0), "vfov": 40}
    wall = sr.Plane(point=(0, 0, 0), normal=(0, 0, 1), material=sr.Lambert(albedo=1))
    camera = sr.PerspectiveCamera(width=16, height=12, **pose)
    scene = sr.Scene(wall, ProjectorLight(image=picture, filter="nearest", intensity=16 * math.pi, **pose), camera=camera)
    image = np.asarray(sr.render(scene, sr.Whitted(), samples=1, filter=sr.BoxFilter()))
    centres = np.stack(np.meshgrid(np.arange(16) + 0.5, np.arange(12) + 0.5), axis=-1)
    cosine = -camera.rays(centres)[1][..., 2]
    close = np.abs(image - picture * cosine[..., None] ** 3) < 0.05 * picture.max()  # rays fall anywhere in a pixel
    assert close.all()
    assert ((image > 0) == (picture > 0)).all()


@pytest.mark.parametrize(("fields", "message"), [
    ({"eye": (1, 2, 3), "target": (1, 2, 3)}, "ProjectorLight: eye and target are the same point"),
    ({"up": (0, 0, 2)}, r"ProjectorLight: up .* is parallel to the line of sight"),
    ({"image": None}, r"ProjectorLight\.image: missing"),
    ({"vfov": 180}, r"ProjectorLight\.vfov: got 180"),
    ({"filter": "cubic"}, r"ProjectorLight\.filter: .*cubic"),
])  # fmt: skip
def test_errors_of_projectors(fields, message):
    with pytest.raises(SceneError, match=message):
        ProjectorLight(**{"image": np.ones((2, 2, 3)), **fields})
