"""Eight paths side by side against the same paths one at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray._jit import implements, kernel, native
from sightray.accelerators.grid import Grid
from sightray.cameras.base import generate_eight
from sightray.engine.batches import render_tile_in_batches
from sightray.integrators.eightpieces import some_piece
from sightray.materials.base import BsdfSample, sample_bsdf
from sightray.mathlib.eight_paths import load8v
from sightray.mathlib.eights import load8d, load8i, splat8i, store8d, store8i
from sightray.mathlib.lanes import movemask8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, aligned, f64_at, f64_put, i64_at, i64_put, table_at
from sightray.mathlib.vec import Vec3
from sightray.samplers.base import default_sampler
from sightray.scene.compile import compile_scene
from sightray.scene.piece_kernels import blocked8, meet8, spot8
from sightray.scene.pieces import FIRSTS, MOST, PIECES_OF, pieces_of
from sightray.scene.world import PIECES, find_closest, is_blocked
from sightray.textures.base import Where

ROOM = np.array([[-2, 0, -2], [2, 0, -2], [2, 0, 2], [-2, 0, 2], [-2, 3, -2], [2, 3, -2], [2, 3, 2], [-2, 3, 2]], float)
SIDES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]  # so that no normal lies along an axis
TURN *= np.sign(np.linalg.det(TURN))


def box(lower, upper, material):
    """A box as one mesh of twelve triangles, turned as all is."""
    corners = (np.array(lower) + (ROOM - ROOM[0]) / (ROOM[6] - ROOM[0]) * (np.array(upper) - lower)) @ TURN.T
    faces = [t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))]
    return sr.Mesh(vertices=corners, faces=faces, material=material)


def at(*point):
    return tuple((TURN @ np.array(point, float)).tolist())


def camera(**more):
    return sr.PerspectiveCamera(**{"eye": at(0.3, 1.4, 1.9), "target": at(0, 0.8, -1), "up": at(0, 1, 0), "vfov": 70,
                                   "width": 40, "height": 30} | more)  # fmt: skip


def room(*more, **options):
    """Matte walls, a block, a mirror ball and a ball of glass."""
    return sr.Scene(
        box((-2, 0, -2), (2, 3, 2), sr.Lambert(albedo=(0.7, 0.6, 0.5))),
        box((-1.5, 0, -1.4), (-0.6, 1.2, -0.5), sr.Lambert(albedo=(0.2, 0.5, 0.7))),
        sr.Sphere(center=at(0.2, 0.5, -0.9), radius=0.45, material=sr.Glass(ior=1.5, tint=(0.9, 1, 1))),
        sr.Sphere(center=at(1.2, 0.6, -0.3), radius=0.5, material=sr.Mirror(reflectance=(0.9, 0.8, 0.7))),
        *more, **{"camera": camera()} | options,
    )  # fmt: skip


def lamp(**more):
    return sr.RectangleLight(corner=at(-0.5, 2.9, -0.5), edge_u=at(1, 0, 0), edge_v=at(0, 0, 1), radiance=9, **more)


def lit_room(**options):
    return room(lamp(), **options)


def room_of_lamps():
    """Lights of all kinds: with and without a place, painted black behind, glowing meshes."""
    glow = sr.Lambert(albedo=0.3, emission=(3, 2, 1))
    shine = sr.Emitter(radiance=4)
    screen = sr.Rectangle(corner=at(-1.9, 1, 1), edge_u=at(0, 0.8, 0), edge_v=at(0, 0, -1.2), material=shine)
    return room(
        lamp(), sr.SphereLight(center=at(1, 2.2, 1), radius=0.2, radiance=(20, 5, 5)), screen,
        sr.PointLight(position=at(-1, 2, 0), intensity=2), box((1.2, 0, 1.1), (1.6, 0.3, 1.5), glow),
        sr.Sphere(center=at(0, 2.4, 1.2), radius=0.1, material=sr.Emitter(radiance=(2, 9, 2))),
    )  # fmt: skip


def open_under_sky():
    return sr.Scene(
        box((-3, -1, -3), (3, 0, 3), sr.Lambert(albedo=0.6)),
        sr.Triangle(a=at(-1, 0, -1), b=at(0, 0, -1.5), c=at(-0.4, 1.5, -1), material=sr.Lambert(albedo=(0.8, 0.2, 0.2))),
        sr.Sphere(center=at(0.8, 0.5, 0), radius=0.5, material=sr.Glass(ior=1.4)),
        sr.EnvironmentLight(radiance=(0.4, 0.6, 1.0)), sr.DirectionalLight(direction=at(-1, -2, -1), irradiance=2),
        camera=camera(), background=(0.1, 0.0, 0.2),
    )  # fmt: skip


def wide_lamp():
    """A lamp that is near everywhere: it is cut by solid angles."""
    return room(sr.RectangleLight(corner=at(-1.8, 2.9, -1.8), edge_u=at(3.6, 0, 0), edge_v=at(0, 0, 3.6), radiance=2))


def without_lights():
    floor = box((-3, -1, -3), (3, 0, 3), sr.Lambert(albedo=0.6))
    return sr.Scene(floor, sr.Sphere(center=at(0, 0.6, 0), radius=0.5), camera=camera(), background=(1, 0.5, 0.2))


SCENES = {"lit room": lit_room, "lamps": room_of_lamps, "wide lamp": wide_lamp, "sky": open_under_sky,
          "no lights": without_lights}  # fmt: skip


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


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("options", [{}, {"max_depth": 3, "roulette_depth": 0}, {"clamp": 0.3, "light_samples": 3}])
def test_paths_are_the_same_as_one_at_a_time(name, options):
    scene, tracer = SCENES[name](), sr.PathTracer(**options)
    assert compile_scene(scene).in_pieces
    eight, one = sr.render(scene, tracer, samples=5), one_at_a_time(scene, tracer, samples=5)
    assert_same(eight, one)
    assert eight.info["rays"] == pytest.approx(one.info["rays"], rel=1e-3)


@pytest.mark.parametrize("sampler", ["independent", "stratified", "halton", "sobol", "bluenoise"])
def test_samplers_draw_the_same(sampler):
    chosen = {"independent": sr.IndependentSampler, "stratified": sr.StratifiedSampler, "halton": sr.HaltonSampler,
              "sobol": sr.SobolSampler, "bluenoise": sr.BlueNoiseSampler}[sampler]()  # fmt: skip
    scene, tracer = lit_room(), sr.PathTracer()
    options = {"samples": 6, "sampler": chosen, "seed": 3}
    assert_same(sr.render(scene, tracer, **options), one_at_a_time(scene, tracer, **options))


@pytest.mark.parametrize("filter", [sr.TentFilter(), sr.MitchellFilter(), sr.GaussianFilter(radius=3)])
@pytest.mark.parametrize("lens", [{"lens_radius": 0.05, "focus_distance": 2.0}, {}])
def test_lenses_and_filters_aim_the_same(filter, lens):
    kind = sr.ThinLensCamera if lens else sr.PerspectiveCamera
    scene = lit_room(camera=kind(**(camera().values() | lens)))
    options = {"samples": 4, "filter": filter}
    assert_same(sr.render(scene, sr.PathTracer(), **options), one_at_a_time(scene, sr.PathTracer(), **options))


def test_the_first_of_one_sample_goes_through_the_middle():
    assert_same(sr.render(lit_room(), sr.PathTracer(), samples=1), one_at_a_time(lit_room(), sr.PathTracer(), samples=1))


@pytest.mark.parametrize("scale", [1e-3, 1e5])
def test_scenes_of_any_size(scale):
    def sized(points):
        return tuple((scale * np.array(points)).tolist())

    ball = sr.Sphere(center=sized(at(0.2, 0.5, -0.9)), radius=0.45 * scale, material=sr.Mirror())
    walls = box((-2, 0, -2), (2, 3, 2), sr.Lambert(albedo=0.6))
    light = sr.RectangleLight(corner=sized(at(-0.5, 2.9, -0.5)), edge_u=sized(at(1, 0, 0)), edge_v=sized(at(0, 0, 1)))
    eye = camera(eye=sized(camera().eye), target=sized(camera().target))
    scene = sr.Scene(walls.with_vertices(walls.vertices * scale), ball, light, camera=eye)
    assert_same(sr.render(scene, sr.PathTracer(), samples=4), one_at_a_time(scene, sr.PathTracer(), samples=4))


def test_threads_and_tiles_change_nothing():
    scene, tracer = lit_room(camera=camera(width=70, height=40)), sr.PathTracer()
    one, three = (sr.render(scene, tracer, samples=9, threads=n) for n in (1, 3))
    np.testing.assert_array_equal(three, one)


def test_uneven_samples_are_counted_right():
    scene = lit_room()
    image = sr.render(scene, sr.PathTracer(), samples=40, adaptive="error")
    counts = image.info["sample_count"]
    assert 16 <= counts.min() < counts.max()
    assert counts.mean() == pytest.approx(40, rel=0.02)
    assert_same(image, one_at_a_time(scene, sr.PathTracer(), samples=40, adaptive="error"), strays=0.01)


# --------------------------------------------------------------------------------------- which scenes are made of pieces


def made_of_pieces(*things, **options):
    scene = sr.Scene(*things, **{"camera": camera()} | options)
    return compile_scene(scene).in_pieces


@pytest.mark.parametrize("material", [
    sr.Mix(a=sr.Mirror(), b=sr.Lambert()), sr.Lambert(albedo=sr.Checker()), sr.Glass(absorption=(1, 2, 3)),
    sr.Cutout(material=sr.Lambert(), opacity=0.5), sr.NormalMap(material=sr.Lambert(), map=sr.Checker()),
    sr.TwoSided(material=sr.Lambert(), back=sr.Mirror()), sr.Emitter(radiance=sr.Checker()),
])  # fmt: skip
def test_other_materials_are_left_to_single_paths(material):
    assert not made_of_pieces(sr.Sphere(material=material))


def test_other_shapes_places_and_media_are_left_to_single_paths():
    ball, corners = sr.Sphere(), np.eye(3)
    assert made_of_pieces(ball)
    assert not made_of_pieces(sr.Cylinder())
    assert not made_of_pieces(ball.replace(transform=sr.Transform.translate(1, 0, 0)))
    assert not made_of_pieces(sr.Mesh(vertices=corners, faces=[(0, 1, 2)], normals=corners))
    assert not made_of_pieces(*[sr.Sphere(center=(3 * k, 0, 0)) for k in range(MOST + 1)])
    assert not made_of_pieces(ball, medium=sr.HomogeneousMedium(absorption=1))
    assert not compile_scene(sr.Scene(ball, camera=camera()), Grid()).in_pieces  # who asks for a grid gets it
    assert not made_of_pieces(sr.PointLight(position=(0, 1, 0)))


class Painted(sr.Lambert):
    """A material whose author knows nothing of eight paths."""


@implements(sample_bsdf, Painted)
def sample_painted(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    return BsdfSample(wo, Vec3(0.5, 0.5, 0.5), 0.0)


def test_who_changes_a_material_for_one_path_is_followed_alone():
    assert not made_of_pieces(sr.Sphere(material=Painted()))
    assert sr.ThinLensCamera.kernels[generate_eight] is sr.FisheyeCamera.kernels[generate_eight]
    assert sr.ThinLensCamera.kernels[generate_eight] is not sr.PerspectiveCamera.kernels[generate_eight]


def test_triangles_make_up_quadrilaterals_where_they_are_flat_convex_and_dark():
    square, bend = [(0, 0, 0), (1, 0, 0), (1.2, 1, 0), (0, 1, 0)], [(0, 0, 0), (1, 0, 0), (1, 1, 0.1), (0, 1, 0)]
    dent, faces = [(0, 0, 0), (1, 0, 0), (0.1, 0.1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)]

    def flats(corners, faces=faces, **more):
        mesh = sr.Mesh(vertices=corners, faces=faces, **more)
        found = pieces_of(compile_scene(sr.Scene(mesh)).items, [0])
        assert found is not None
        return [(len(flat.corners), flat.prims) for flat in found[0]]

    assert flats(square) == [(4, (0, 1))]
    assert flats(square, [(1, 2, 0), (3, 0, 2)]) == [(4, (0, 1))]
    assert flats(square, [(0, 1, 2), (0, 3, 2)]) == [(3, (0,)), (3, (1,))]  # back to front
    assert flats(bend) == flats(dent) == [(3, (0,)), (3, (1,))]
    assert flats(square, material=sr.Emitter()) == [(3, (0,)), (3, (1,))]


# ------------------------------------------------------------------------------------------------- rays against pieces


@kernel
def ask_both(world: Table, rays: Table, n: i64, out: Table) -> None:
    """For rays (o, d, reach, own) in eights: pieces and doubts of the filter, t, and the same exactly."""
    pieces = table_at(world, PIECES)
    for i in range(n):
        r, w = 64 * i, 64 * i
        o, d = load8v(rays, r), load8v(rays, r + 24)
        reach, own = load8d(rays, r + 48), load8i(rays, r + 56)
        met = meet8(pieces, o, d, own)
        shade = blocked8(pieces, o, d, reach, own, splat8i(-1))
        store8i(out, w, met.piece)
        i64_put(out, w + 8, movemask8(met.unsure))
        i64_put(out, w + 9, movemask8(shade.blocked))
        i64_put(out, w + 10, movemask8(shade.unsure))
        store8d(out, w + 16, spot8(pieces, o, d, own, some_piece(met.piece)).t)
        for k in range(8):
            p = Vec3(f64_at(rays, r + k), f64_at(rays, r + 8 + k), f64_at(rays, r + 16 + k))
            way = Vec3(f64_at(rays, r + 24 + k), f64_at(rays, r + 32 + k), f64_at(rays, r + 40 + k))
            t_min = 1e-9
            hit = find_closest(world, p, way, t_min, math.inf)
            f64_put(out, w + 32 + k, hit.t)
            piece = -1
            if hit.item >= 0:
                piece = i64_at(table_at(pieces, PIECES_OF), i64_at(table_at(pieces, FIRSTS), hit.item) + hit.prim)
            i64_put(out, w + 24 + k, piece)
            i64_put(out, w + 40 + k, 1 if is_blocked(world, p, way, t_min, f64_at(rays, r + 48 + k)) else 0)


class Answers:
    """What the filter and the exact search say of n rays."""

    def __init__(self, scene, o, d, reach, own):
        compiled = compile_scene(scene)
        compiled.tables.row_of(sr.PathTracer().for_batches(compiled))
        compiled.tables.row_of(default_sampler())
        compiled.tables.prepare(render_tile_in_batches)
        compiled.tables.prepare(ask_both)
        n = len(o) // 8
        rays, out = aligned((n, 64), np.float64), aligned((n, 64), np.float64)
        for at, values in ((0, o), (24, d)):
            rays[:, at : at + 24] = np.reshape(values, (n, 8, 3)).transpose(0, 2, 1).reshape(n, 24)
        rays[:, 48:56] = np.broadcast_to(reach, len(o)).reshape(n, 8)
        rays.view(np.int64)[:, 56:] = np.broadcast_to(own, len(o)).reshape(n, 8)
        native(ask_both)(compiled.world, Table(rays), n, Table(out))
        whole = out.view(np.int64)

        def bits(word):
            return ((whole[:, word, None] >> np.arange(8)) & 1 != 0).ravel()

        self.piece, self.exact_piece = whole[:, :8].ravel(), whole[:, 24:32].ravel()
        self.unsure, self.blocked, self.in_doubt = bits(8), bits(9), bits(10)
        self.t, self.exact_t = out[:, 16:24].ravel(), out[:, 32:40].ravel()
        self.exact_blocked = whole[:, 40:48].ravel() != 0

    def check(self):
        """What is sure is right: the same piece at the same distance, and the same shadow."""
        sure = ~self.unsure
        np.testing.assert_array_equal(self.piece[sure], self.exact_piece[sure])
        met = sure & (self.piece >= 0)
        np.testing.assert_allclose(self.t[met], self.exact_t[met], rtol=1e-9)
        np.testing.assert_array_equal(self.blocked[~self.in_doubt], self.exact_blocked[~self.in_doubt])
        assert not (self.blocked & self.in_doubt).any()


def directions(rng, n):
    d = rng.normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.parametrize("offset", [0.0, 30.0, 1e4])
def test_rays_meet_what_they_meet_alone(offset):
    rng, n = np.random.default_rng(11), 8000
    o = rng.uniform((-1.9, 0.1, -1.9), (1.9, 2.9, 1.9), (n, 3)) @ TURN.T
    d = directions(rng, n)
    found = Answers(lit_room(), o - offset * d, d, offset + rng.uniform(0, 4, n), -1)
    found.check()
    assert found.unsure.mean() < (0.02 if offset < 100 else 1.1)  # from far away singles know better
    assert (found.exact_piece >= 0).all()
    assert 0.2 < found.blocked.mean()


def test_rays_that_leave_a_piece_do_not_meet_it_again_but_for_the_inside_of_balls():
    rng, n, scene = np.random.default_rng(12), 8000, lit_room()
    o = rng.uniform((-1.9, 0.1, -1.9), (1.9, 2.9, 1.9), (n, 3)) @ TURN.T
    d = directions(rng, n)
    first = Answers(scene, o, d, 1.0, -1)
    p, own = o + d * first.t[:, None], np.where(first.unsure, -1, first.piece)
    found = Answers(scene, p, directions(rng, n), rng.uniform(0.1, 4, n), own)
    found.check()
    assert found.unsure.mean() < 0.01
    flats = len(pieces_of(compile_scene(scene).items, [0] * 5)[0])
    again = ~found.unsure & (found.piece == own) & (own >= 0)
    assert again.any()
    assert (own[again] >= flats).all()


def test_rays_at_edges_and_corners_are_in_doubt_and_nothing_leaks():
    rng, n, scene = np.random.default_rng(13), 8000, sr.Scene(box((-2, 0, -2), (2, 3, 2), sr.Lambert()), camera=camera())
    corners = ROOM @ TURN.T
    side, place = np.array(SIDES)[rng.integers(0, 6, n)], rng.integers(0, 4, n)
    one, other = (corners[side[np.arange(n), (place + turn) % 4]] for turn in (0, 1))
    aim = one + (other - one) * rng.choice([0.0, 1.0, 0.3, 0.7], n)[:, None]
    o = rng.uniform((-1.9, 0.1, -1.9), (1.9, 2.9, 1.9), (n, 3)) @ TURN.T
    d = (aim - o) / np.linalg.norm(aim - o, axis=1, keepdims=True)
    found = Answers(scene, o, d, 100.0, -1)
    found.check()
    assert found.unsure.mean() > 0.9
    assert (found.exact_piece >= 0).all()
    assert (found.blocked | found.in_doubt).all()


def test_senseless_rays_are_left_to_the_exact_search():
    o, d = np.zeros((8, 3)) + at(0, 1, 0), np.zeros((8, 3))
    d[1:4], d[4] = np.nan, np.inf
    found = Answers(lit_room(), o, d, 1.0, -1)
    assert (found.unsure | (found.piece == -1)).all()
    assert (found.exact_piece == -1).all()
