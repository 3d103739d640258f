"""Eight paths side by side in scenes with trees, against the same paths one at a time."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray._jit import implements
from sightray.accelerators.grid import Grid
from sightray.cameras.base import Ray
from sightray.integrators.base import Radiance, radiance
from sightray.integrators.eightpieces import _AmongPieces
from sightray.integrators.eighttrees import _AmongOthers, _AmongTrees
from sightray.mathlib.table import Table
from sightray.mathlib.vec import grey
from sightray.samplers.base import Draws
from sightray.scene.compile import compile_scene


def one_at_a_time(scene, tracer, **options):
    """The picture of paths that are followed alone: who shares with nobody does that."""
    alone = sr.SharedPathTracer(share=1, **tracer.values())
    assert alone.for_batches(compile_scene(scene)) is None
    return sr.render(scene, alone, **options)


def assert_same(eight, one, strays=0.002):
    """Pictures that are the same but for rounding, which may send a few paths elsewhere."""
    a, b = np.asarray(eight), np.asarray(one)
    assert b.max() > 0
    assert (np.abs(a - b).max(axis=-1) > 1e-5 * (1 + b.max(axis=-1))).mean() <= strays
    np.testing.assert_array_equal(eight.info["sample_count"], one.info["sample_count"])


def bumpy_mesh(n=12, **more):
    """A sheet of hills with normals and texture coordinates."""
    y, x = np.mgrid[0 : n + 1, 0 : n + 1] / n
    z = 0.15 * np.sin(7 * x) * np.cos(5 * y)
    vertices = np.stack([3 * x - 1.5, z, 3 * y - 1.5], axis=-1).reshape(-1, 3)
    k = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([k, k + n + 1, k + 1], 1), np.stack([k + 1, k + n + 1, k + n + 2], 1)])
    steep = np.stack([-0.35 * np.cos(7 * x) * np.cos(5 * y), np.ones_like(x), 0.25 * np.sin(7 * x) * np.sin(5 * y)], -1)
    normals = (steep / np.linalg.norm(steep, axis=-1, keepdims=True)).reshape(-1, 3)
    uvs = np.stack([x, y], axis=-1).reshape(-1, 2)
    return sr.Mesh(vertices=vertices, faces=faces, normals=normals, uvs=uvs, **more)


def picture(seed, side=16):
    return np.random.default_rng(seed).uniform(0.1, 0.9, (side, side, 3)).astype(np.float32)


EYE = sr.PerspectiveCamera(eye=(0.2, 2.2, 2.8), target=(0, 0, 0), vfov=50, width=40, height=30)


def textured_hills():
    """Textures of all filters, relief, holes, a sky and a lamp."""
    paint = sr.Lambert(albedo=sr.Bitmap(image=picture(1), filter="trilinear"))
    leaf = sr.Cutout(material=sr.Lambert(albedo=sr.Checker(scale=0.2)), opacity=sr.Bitmap(image=picture(2)))
    relief = sr.NormalMap(material=sr.Lambert(albedo=sr.Bitmap(image=picture(3))), map=sr.Bitmap(image=picture(4)))
    return sr.Scene(
        bumpy_mesh(material=paint),
        sr.Rectangle(corner=(-1, 0.4, -0.5), edge_u=(0.8, 0.1, 0), edge_v=(0, 0.6, 0.3), material=leaf),
        sr.Sphere(center=(0.7, 0.5, 0.3), radius=0.4, material=relief),
        sr.Sphere(center=(-0.4, 0.4, 0.6), radius=0.3, material=sr.BumpMap(material=sr.Mirror(), height=sr.Noise())),
        sr.EnvironmentLight(image=picture(5)), sr.PointLight(position=(1, 3, 1), intensity=3), camera=EYE,
    )  # fmt: skip


def placed_things():
    """Instances, turned and scaled things, glass, surfaces that glow by a picture."""
    hills, move = bumpy_mesh(6), sr.Transform.translate
    shine = sr.Emitter(radiance=sr.Bitmap(image=4 * picture(6)))
    turn = move(0.3, 0.6, 0) @ sr.Transform.rotate((1, 2, 0), 40) @ sr.Transform.scale(0.3, 0.2, 0.3)
    return sr.Scene(
        *[sr.Instance(of=hills, material=sr.Lambert(albedo=(0.2 + 0.1 * k, 0.5, 0.8 - 0.1 * k)),
                      transform=move(1.1 * (k % 3) - 1.2, 0.1 * k, -1.0 * (k // 3)) @ sr.Transform.scale(0.4))
          for k in range(6)],
        bumpy_mesh(4, material=shine, transform=turn), sr.Torus(material=sr.Glass(ior=1.4), transform=turn),
        sr.Cylinder(material=sr.Glass(), transform=move(0.9, 0, 0.4) @ sr.Transform.scale(0.3)),
        camera=EYE, background=(0.5, 0.6, 0.9),
    )  # fmt: skip


def coarse_ball(n=6, **more):
    """A ball of few triangles, with the normals of a round one."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, 2 * n + 1), indexing="ij")
    p = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1).reshape(-1, 3)
    k = (np.arange(n)[:, None] * (2 * n + 1) + np.arange(2 * n)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + 2 * n + 2], 1), np.stack([k, k + 2 * n + 2, k + 2 * n + 1], 1)])
    corners = p[faces]
    whole = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 1e-9
    return sr.Mesh(vertices=p, faces=faces[whole], normals=p, **more)  # those at the poles have no area


def smooth_ball_by_a_lamp():
    """A coarse mesh that is shaded round: shadow rays begin above it, and some directions are mirrored outside."""
    ball = coarse_ball(material=sr.Lambert(albedo=0.9))
    return sr.Scene(ball, sr.RectangleLight(corner=(-2, 1, 1), edge_u=(0, 0, -1), edge_v=(0, 1, 0), radiance=20),
                    bumpy_mesh(3, material=sr.Glass()), camera=EYE, background=0.1)  # fmt: skip


def room_of_lamps():
    """More lamps than one chooses among at once, one of them a mesh, and a mirror that shows them."""
    lamps = [sr.PointLight(position=(x, 2, z), intensity=0.4) for x in (-2, -1, 0, 1, 2) for z in (-1, 0, 1)]
    glow = coarse_ball(3, material=sr.Emitter(radiance=(3, 2, 1)), transform=sr.Transform.scale(0.3))
    return sr.Scene(bumpy_mesh(material=sr.Mirror()), coarse_ball(4), glow, *lamps, camera=EYE)


def odd_materials():
    """Materials without forms for eight paths among others, an anisotropic one, things that move, a rolling shutter."""
    mixed = sr.Mix(a=sr.Lambert(albedo=sr.Checker(scale=0.3)), b=sr.Mirror(), amount=sr.Bitmap(image=picture(7)))
    sides = sr.TwoSided(material=sr.Lambert(albedo=(0.8, 0.3, 0.2)), back=sr.Emitter(radiance=2))
    brushed = sr.Conductor(metal="Cu", roughness=0.3, anisotropy=0.7)
    ball, away = sr.Sphere(radius=0.3, material=sr.Lambert(albedo=0.7)), sr.Transform.translate(0.6, 0.3, 0)
    return sr.Scene(
        bumpy_mesh(material=mixed), coarse_ball(4, material=brushed, transform=sr.Transform.scale(0.5)),
        sr.Rectangle(corner=(-1.2, 0.2, -0.5), edge_u=(0.8, 0, 0), edge_v=(0, 0.6, 0.3), material=sides),
        sr.Instance(of=ball, motion=[(0, sr.Transform.translate(0.5, 0.4, 0.5)), (1, away)]),
        sr.EnvironmentLight(radiance=0.5), sr.PointLight(position=(1, 3, 1), intensity=3),
        camera=EYE.replace(shutter_open=0.1, shutter_close=0.6, readout=0.3),
    )  # fmt: skip


def shades():
    """Lamps seen from within a ball, by chance and through translucent shades that are shaded round."""
    silk = sr.Principled(base_color=(0.9, 0.7, 0.5), roughness=0.5, transmission=0.8, thin_walled=True)
    move, size = sr.Transform.translate, sr.Transform.scale
    glow = sr.Lambert(albedo=0.2, emission=(5, 4, 3))
    lamps = [coarse_ball(3, material=glow, transform=move(x, 0.4, z) @ size(0.25)) for x, z in ((-1, 0), (0.9, -0.6))]
    cover = coarse_ball(4, material=silk, transform=move(-1, 0.4, 0) @ size(0.6))
    around = coarse_ball(8, material=sr.Lambert(albedo=0.5), transform=size(5.0))
    return sr.Scene(around, cover, *lamps, camera=EYE)


def two_minds():
    """A material that chooses, among others that do not, and has no form for eight paths."""
    mixed = sr.Mix(a=sr.Lambert(albedo=(0.9, 0.1, 0.1)), b=sr.Mirror(), amount=0.5)
    return sr.Scene(
        bumpy_mesh(), coarse_ball(5, material=mixed), sr.PointLight(position=(1, 3, 1), intensity=9), camera=EYE
    )


TREES = {
    "shades": shades,
    "two minds": two_minds,
    "odd": odd_materials,
    "lamps": room_of_lamps,
    "textures": textured_hills,
    "places": placed_things,
    "smooth": smooth_ball_by_a_lamp,
}


def followed_by(scene, tracer=None, accelerator=None):
    return type((tracer or sr.PathTracer()).for_batches(compile_scene(scene, accelerator)))


@pytest.mark.parametrize("name", TREES)
@pytest.mark.parametrize("options", [{}, {"max_depth": 3, "roulette_depth": 0}, {"clamp": 0.3, "light_samples": 3}])
def test_paths_among_trees_are_the_same_as_one_at_a_time(name, options):
    scene, tracer = TREES[name](), sr.PathTracer(**options)
    assert followed_by(scene) is (_AmongOthers if name in ("odd", "two minds") else _AmongTrees)
    eight, one = sr.render(scene, tracer, samples=5), one_at_a_time(scene, tracer, samples=5)
    assert_same(eight, one)
    assert eight.info["rays"] == pytest.approx(one.info["rays"], rel=2e-3)


def test_paths_among_pieces_are_the_same_by_trees():
    floor = sr.Rectangle(corner=(-2, -0.6, -2), edge_u=(0, 0, 4), edge_v=(4, 0.1, 0), material=sr.Lambert(albedo=0.7))
    lamp = sr.RectangleLight(corner=(-1, 3, -1), edge_u=(2, 0, 0.1), edge_v=(0, 0, 2), radiance=3)
    scene, tracer = sr.Scene(floor, sr.Sphere(radius=0.5, material=sr.Glass()), lamp, camera=EYE), sr.PathTracer()
    assert followed_by(scene) is _AmongPieces
    assert followed_by(scene, accelerator=Grid()) is _AmongTrees
    assert_same(sr.render(scene, tracer, samples=5), sr.render(scene, tracer, samples=5, accelerator="grid"))


def test_threads_tiles_and_interruptions_change_nothing(tmp_path):
    scene, tracer = odd_materials(), sr.PathTracer()
    scene = scene.replace(camera=scene.camera.resized(70, 40))
    one = sr.render(scene, tracer, samples=9, threads=1)
    np.testing.assert_array_equal(sr.render(scene, tracer, samples=9, threads=3), one)
    state = tmp_path / "state"

    def stop(progress):
        if progress.stage == "render" and progress.done > 5000:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sr.render(scene, tracer, samples=9, checkpoint=state, progress=stop)
    np.testing.assert_array_equal(sr.render(scene, tracer, samples=9, checkpoint=state, resume=True), one)


def test_pixels_without_a_ray_are_black_and_cost_none():
    scene = textured_hills().replace(
        camera=sr.FisheyeCamera(eye=EYE.eye, target=EYE.target, width=40, height=30, fov=120)
    )
    eight, one = sr.render(scene, sr.PathTracer(), samples=4), one_at_a_time(scene, sr.PathTracer(), samples=4)
    assert_same(eight, one)
    assert (np.asarray(one)[0, 0] == 0).all()
    assert eight.info["rays"] == one.info["rays"]


class Derived(sr.PathTracer):
    """Somebody's own tracer, which changes nothing."""


class Absent(sr.PathTracer):
    """Somebody's own tracer, with its own way to find light."""


@implements(radiance, Absent)
def find_nothing(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    return Radiance(grey(0.25), 1)


def test_who_changes_the_tracer_is_asked_for_each_ray():
    assert followed_by(textured_hills(), Derived()) is _AmongTrees
    assert Absent().for_batches(compile_scene(textured_hills())) is None
    np.testing.assert_array_equal(sr.render(textured_hills(), Absent(), samples=1), 0.25)


@pytest.mark.parametrize("material", [
    sr.Glass(absorption=(1, 2, 3)), sr.Mix(a=sr.Lambert(), b=sr.Mirror()), sr.Subsurface(preset="skin1"),
    sr.Boundary(interior=sr.HomogeneousMedium(absorption=1)),
])  # fmt: skip
def test_what_is_filled_and_what_has_no_forms_is_followed_alone(material):
    assert sr.PathTracer().for_batches(compile_scene(sr.Scene(sr.Sphere(material=material), camera=EYE))) is None


class Ghost(sr.Lambert):
    """A surface that light passes as if it were not there."""

    @property
    def clear(self):
        return True


def test_media_wavelengths_and_other_tracers_are_followed_alone():
    scene = sr.Scene(sr.Sphere(), camera=EYE, medium=sr.HomogeneousMedium(absorption=1))
    assert sr.PathTracer().for_batches(compile_scene(scene)) is None
    assert sr.PathTracer(spectral=True).for_batches(compile_scene(textured_hills())) is None
    ghost = sr.Scene(sr.Sphere(material=Ghost()), camera=EYE)
    assert sr.PathTracer().for_batches(compile_scene(ghost)) is None
    assert sr.Whitted().for_batches(compile_scene(textured_hills())) is None
