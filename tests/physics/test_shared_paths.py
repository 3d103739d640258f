"""`SharedPathTracer` paints the picture of `PathTracer`, with less noise."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray.engine.run import _Job

SEEDS = 12


def small(scene, height=32):
    camera = scene.camera
    return scene.replace(camera=camera.resized(round(height * camera.width / camera.height), height), ambient=0)


def cornell():
    return small(sr.load("cornell"))


def still_life():
    """Glass and mirrors: caustics, and matte surfaces seen in mirrors."""
    return small(sr.load("still-life"))


def shiny_room():
    """Surfaces between matte and mirror, a texture, a lampshade that light passes, and a smooth coarse mesh."""
    floor = sr.Principled(base_color=sr.Checker(even=(0.8, 0.7, 0.2), odd=0.1), roughness=0.3, metallic=0.5)
    ball = sr.Principled(base_color=(0.7, 0.2, 0.2), roughness=0.15, clearcoat=1.0)
    coarse = sr.Sphere(center=(0.9, 0.4, 0.2), radius=0.4, material=sr.OrenNayar(albedo=0.6, sigma=30))
    shade = sr.Rectangle(corner=(-1.2, 1.1, -0.6), edge_u=(0.8, 0, 0), edge_v=(0, 0, 0.8),
                         material=sr.Mix(a=sr.Lambert(albedo=0.6), b=sr.Mirror(reflectance=0.7), amount=0.5))  # fmt: skip
    return sr.Scene(
        sr.Box(lower=(-2, 0, -2), upper=(2, 2.5, 3), material=sr.Lambert(albedo=(0.7, 0.75, 0.8))),
        sr.Rectangle(corner=(-2, 0.001, 3), edge_u=(4, 0, 0), edge_v=(0, 0, -5), material=floor),
        sr.Sphere(center=(-0.3, 0.5, -0.3), radius=0.5, material=ball), coarse, shade,
        sr.RectangleLight(corner=(-0.4, 2.4, -0.4), edge_u=(0.8, 0, 0), edge_v=(0, 0, 0.8), radiance=6),
        sr.Sphere(center=(1.3, 1.6, -1), radius=0.2, material=sr.Emitter(radiance=(3, 1, 1))),
        camera=sr.PerspectiveCamera(eye=(0, 1.2, 2.6), target=(0, 0.7, -1), vfov=60, width=40, height=32),
    )  # fmt: skip


def fog_and_sky():
    """A body of milk, glass under a sky, and a lens with a shutter: much of it nobody shares."""
    return sr.Scene(
        sr.Plane(point=(0, 0, 0), normal=(0, 1, 0), material=sr.Lambert(albedo=0.6)),
        sr.Sphere(center=(-0.8, 0.5, 0), radius=0.5, material=sr.Glass(ior=1.5)),
        sr.Sphere(center=(0.6, 0.6, 0), radius=0.6, material=sr.Subsurface(preset="skim milk", scale=0.05)),
        sr.EnvironmentLight(radiance=(0.5, 0.7, 1.0)),
        sr.SphereLight(center=(0, 3, 1), radius=0.3, radiance=10),
        camera=sr.PerspectiveCamera(eye=(0, 1.2, 4), target=(0, 0.5, 0), vfov=40, width=40, height=32),
    )  # fmt: skip


def stripes():
    """Lit and shaded pixels in turns, which judge differently what is worth sharing; a mirror for a wall."""
    slats = [[(-1, 0.6, z), (1, 0.6, z), (1, 0.6, z + 0.032), (-1, 0.6, z + 0.032)] for z in np.arange(-1, 1, 0.064)]
    faces = [t for k in range(len(slats)) for t in ((4 * k, 4 * k + 1, 4 * k + 2), (4 * k, 4 * k + 2, 4 * k + 3))]
    return sr.Scene(
        sr.Box(lower=(-1, 0, -1), upper=(1, 2, 1), material=sr.Lambert(albedo=0.5)),
        sr.Mesh(vertices=np.reshape(slats, (-1, 3)), faces=faces, material=sr.Lambert(albedo=0.5)),
        sr.Rectangle(corner=(-0.9, 0.1, -0.8), edge_u=(0, 0.4, 0), edge_v=(0, 0, 1.6), material=sr.Mirror(reflectance=0.9)),
        sr.RectangleLight(corner=(-0.01, 1.9, -0.01), edge_u=(0.02, 0, 0), edge_v=(0, 0, 0.02), radiance=5000),
        camera=sr.PerspectiveCamera(eye=(-0.4, 0.5, 0), target=(-0.4, 0, 0), up=(0, 0, 1), vfov=60, width=24, height=24),
    )  # fmt: skip


def pictures(scene, integrator, samples, first):
    found = [
        np.asarray(sr.render(scene, integrator, samples=samples, seed=first + k), np.float64) for k in range(SEEDS)
    ]
    return np.stack(found)


def in_cells(images, side):
    """Means over squares of pixels, (n, cells, 3)."""
    n, h, w, _ = images.shape
    return images.reshape(n, h // side, side, w // side, side, 3).mean(axis=(2, 4)).reshape(n, -1, 3)


@pytest.mark.parametrize(
    ("room", "side"), [(cornell, 8), (still_life, 8), (shiny_room, 8), (fog_and_sky, 8), (stripes, 2)]
)
def test_the_picture_is_that_of_path_tracing(room, side):
    """Means over squares of pixels differ by what their spread over independent renders allows."""
    scene = room()
    h, w = scene.camera.height // side * side, scene.camera.width // side * side
    plain = in_cells(pictures(scene, sr.PathTracer(max_depth=6), 32, 0)[:, :h, :w], side)
    shared = in_cells(pictures(scene, sr.SharedPathTracer(max_depth=6), 16, 1000)[:, :h, :w], side)
    error = np.sqrt((plain.var(axis=0, ddof=1) + shared.var(axis=0, ddof=1)) / SEEDS)
    z = (plain.mean(axis=0) - shared.mean(axis=0)) / np.maximum(error, 1e-9)
    assert np.abs(z).max() < 6.0  # Student's t with about 20 degrees of freedom
    assert np.sqrt((z**2).mean()) < 1.3
    whole = plain.mean(axis=(1, 2)), shared.mean(axis=(1, 2))
    spread = np.sqrt((whole[0].var(ddof=1) + whole[1].var(ddof=1)) / SEEDS)
    assert abs(whole[0].mean() - whole[1].mean()) < 3.5 * spread


def two_rooms():
    """Two rooms that are open to the viewer, with a wall between, seen edge on; the lamp is in the right one."""

    def side(corner, u, v):
        return sr.Rectangle(corner=corner, edge_u=u, edge_v=v, material=sr.Lambert(albedo=0.8))

    return sr.Scene(
        side((-1, 0, -2), (2, 0, 0), (0, 1, 0)), side((-1, 0, 0), (2, 0, 0), (0, 0, -2)),
        side((-1, 1, 0), (2, 0, 0), (0, 0, -2)), side((-1, 0, 0), (0, 1, 0), (0, 0, -2)),
        side((1, 0, 0), (0, 1, 0), (0, 0, -2)), side((0, 0, 0), (0, 1, 0), (0, 0, -2)),
        sr.RectangleLight(corner=(0.3, 0.99, -1.2), edge_u=(0.4, 0, 0), edge_v=(0, 0, 0.4), radiance=8),
        camera=sr.PerspectiveCamera(eye=(0, 0.5, 4), target=(0, 0.5, 0), vfov=16, width=32, height=32),
    )  # fmt: skip


def test_walls_keep_light_out():
    """Pixels on both sides of the wall are in the same squares; none may see what is behind it."""
    image = np.asarray(sr.render(two_rooms(), sr.SharedPathTracer(max_depth=5), samples=16))
    assert image[:, :15].max() == 0
    assert image[8:24, 17:].min() > 0


def test_rooms_have_less_noise():
    """Of most pixels of a room the variance falls to a fraction."""
    plain, shared = (pictures(cornell(), kind(max_depth=6), 16, 0) for kind in (sr.PathTracer, sr.SharedPathTracer))
    before, after = (images.var(axis=0).mean(axis=-1) for images in (plain, shared))
    assert np.median(before) > 3.0 * np.median(after)


def test_caustics_have_less_noise():
    scene = small(sr.load("still-life"), 64)
    plain, shared = (pictures(scene, kind(max_depth=6), 8, 0) for kind in (sr.PathTracer, sr.SharedPathTracer))
    size = plain.mean(axis=0) ** 2 + 0.01
    assert (plain.var(axis=0) / size).mean() > 1.5 * (shared.var(axis=0) / size).mean()


def test_who_shares_with_nobody_is_a_path_tracer():
    scene = shiny_room()  # in the Cornell box eight paths go together: tests/oracles/test_eightpaths.py
    alone = sr.render(scene, sr.SharedPathTracer(share=1), samples=2)
    np.testing.assert_array_equal(alone, sr.render(scene, sr.PathTracer(), samples=2))
    spectral = sr.render(scene, sr.SharedPathTracer(spectral=True), samples=2)
    np.testing.assert_array_equal(spectral, sr.render(scene, sr.PathTracer(spectral=True), samples=2))


@pytest.mark.parametrize("share", [3, 8])
def test_threads_change_nothing(share):
    scene = small(sr.load("cornell"), 48)
    one, two = (sr.render(scene, sr.SharedPathTracer(share=share), samples=3, threads=n) for n in (1, 2))
    np.testing.assert_array_equal(one, two)


def test_each_pixel_has_its_samples_where_they_are_uneven():
    scene = cornell()
    image = sr.render(scene, sr.SharedPathTracer(), samples=40, adaptive="error")
    counts = image.info["sample_count"]
    assert 16 <= counts.min() < counts.max()
    assert counts.mean() == pytest.approx(40, rel=0.02)


def test_a_render_goes_on_where_it_stopped(tmp_path):
    scene, options = cornell(), {"samples": 28, "adaptive": "error"}
    whole = sr.render(scene, sr.SharedPathTracer(), **options)
    pieces = 0
    while True:

        def press(progress, after=6000 * (pieces + 1)):
            if progress.stage == "render" and progress.done >= after:
                raise KeyboardInterrupt

        try:
            again = sr.render(scene, sr.SharedPathTracer(), **options, checkpoint=tmp_path / "state",
                              resume=pieces > 0, progress=press)  # fmt: skip
            break
        except KeyboardInterrupt:
            pieces += 1
    assert pieces >= 2
    np.testing.assert_array_equal(whole, again)


def test_tiles_lie_elsewhere_from_time_to_time(monkeypatch):
    """Nothing is shared across their edges, which would show if they stayed; each time they cover the picture once."""
    whole, seen = _Job._tiles, []

    def noted(job, left, up):
        tiles = list(whole(job, left, up))
        seen.append((left, up))
        covered = np.zeros((job.film.height, job.film.width), int)
        for x0, y0, x1, y1 in tiles:
            covered[y0:y1, x0:x1] += 1
        assert (covered == 1).all()
        return iter(tiles)

    monkeypatch.setattr(_Job, "_tiles", noted)
    scene = cornell()
    picture = sr.render(scene, sr.SharedPathTracer(max_depth=2), samples=64)
    assert (picture.info["sample_count"] == 64).all()
    assert len(set(seen)) == len(seen) >= 8
