"""Every shape against an independent definition of its surface, over the registry."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from shape_examples import EXAMPLES, norm

from sightray._jit import address, kernel, native, needed_kernels
from sightray.accelerators.item import (
    ITEM_WORDS,
    MET,
    MOVED,
    OBJECT_FROM_WORLD,
    SHAPE,
    WORLD_FROM_OBJECT,
    ItemHit,
    intersect_item,
    item_surface,
    occluded_item,
    to_object,
)
from sightray.errors import SceneError
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import (
    Space,
    Table,
    advance,
    f64_at,
    f64_put,
    link,
    set_methods,
    table_at,
    vec3_at,
    vec3_put,
)
from sightray.mathlib.transform import Transform, put_columns
from sightray.registry import members
from sightray.shapes.base import facing

RAY, OUT = 12, 24
ALL = [pytest.param(e, id=f"{name}-{i}") for name, examples in EXAMPLES.items() for i, e in enumerate(examples)]


@kernel
def trace(item: Table, rays: Table, out: Table, n: i64) -> None:
    """Ask an item everything about n rays: o, d, t_min, t_max in twelve words each."""
    for i in range(n):
        ray, to = advance(rays, RAY * i), OUT * i
        o, d, t_min, t_max = vec3_at(ray, 0), vec3_at(ray, 4), f64_at(ray, 8), f64_at(ray, 9)
        h = intersect_item(item, o, d, t_min, t_max)
        f64_put(out, to, h.t)
        f64_put(out, to + 1, float(h.prim))
        f64_put(out, to + 2, 1.0 if occluded_item(item, o, d, t_min, t_max) else 0.0)
        if h.prim >= 0:
            p = to_object(item, o + d * h.t)
            s = item_surface(item, ItemHit(h.t, 0, h.prim, h.u, h.v), p)
            f64_put(out, to + 3, s.u)
            f64_put(out, to + 4, s.v)
            vec3_put(out, to + 8, s.normal)
            vec3_put(out, to + 12, s.shading)
            vec3_put(out, to + 16, s.tangent)
            vec3_put(out, to + 20, facing(table_at(item, MET), h, p))


class Packer:
    """As little of a scene compiler as one shape needs."""

    def __init__(self, compiled):
        self.space, self.compiled = Space(), compiled

    def row_of(self, member):
        row = self.space.row(member.row_words())
        member.pack(row, self)
        needed = needed_kernels(trace, [type(member)])[type(member)]
        set_methods(row, [(slot, f, address(f) if self.compiled else 0) for slot, f in needed.items()])
        return row


class Traced:
    """What a shape says about rays, as arrays."""

    def __init__(self, shape, o, d, t_min=0.0, t_max=np.inf, transform=None, compiled=True):
        packer = Packer(compiled)
        item = packer.space.row(ITEM_WORDS)
        row = packer.row_of(shape)
        link(item, SHAPE, row)
        link(item, MET, row)
        if transform is not None:
            item.view(np.int64)[MOVED] = 1
            put_columns(item, OBJECT_FROM_WORLD, transform.inverse)
            put_columns(item, WORLD_FROM_OBJECT, transform.matrix)
        rays, out = np.zeros((len(o), RAY)), np.zeros((len(o), OUT))
        rays[:, 0:3], rays[:, 4:7], rays[:, 8], rays[:, 9] = o, d, t_min, t_max
        (native(trace) if compiled else trace)(item, Table(rays), Table(out), len(o))
        self.t, self.prim, self.dark, self.u, self.v = out[:, 0], out[:, 1], out[:, 2] > 0, out[:, 3], out[:, 4]
        self.normal, self.shading, self.tangent = out[:, 8:11], out[:, 12:15], out[:, 16:19]
        self.facing = out[:, 20:23]
        self.hit = np.isfinite(self.t)
        self.p = o + d * np.where(self.hit, self.t, 0)[:, None]


def size_of(shape):
    lower, upper = shape.bounds()
    if not np.isfinite(lower).all():
        return np.zeros(3), 2.0
    return 0.5 * (lower + upper), 0.5 * float(norm(upper - lower))


def rays_for(shape, n=150, easy=False):
    """Rays of all kinds near a shape: o and d. Easy ones neither graze, nor aim at poles, nor come from afar."""
    rng = np.random.default_rng(7)
    center, size = size_of(shape)

    def around(scale, count=n):
        return center + size * scale * rng.normal(size=(count, 3)) / 1.7

    # Aim at points of the surface, and half of the time past them.
    probe = around(2, 5000)
    seen = Traced(shape, probe, around(0.4, 5000) - probe)
    aims = seen.p[seen.hit & (norm(seen.p - center) < 10 * size)]

    def aim(count):
        return rng.choice(aims, count) + rng.choice([0, 0.1], (count, 1)) * size * rng.normal(size=(count, 3))

    sets = [(around(2), aim(n)), (around(0.4), aim(n)), (around(1e4, n // 2), aim(n // 2))]
    if easy:
        sets = sets[:2]
    o, d = (np.concatenate(part) for part in zip(*[(a, b - a) for a, b in sets], strict=True))

    # Along the axes, with exact zeros; some through the very centre.
    straight = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (10, 1))
    through = aim(60)
    through[: 0 if easy else 6] = center
    o, d = np.concatenate([o, through - 3 * size * straight]), np.concatenate([d, straight])

    if easy:
        return o, d * rng.uniform(0.2, 5, size=(len(o), 1))

    # Past the surface: through hit points along their tangents, a little above or below.
    seen = Traced(shape, o, d)
    good = seen.hit & (norm(o - center) < 100 * size)
    n1 = seen.normal[good] / norm(seen.normal[good])[:, None]
    along = np.cross(n1, rng.normal(size=n1.shape))
    height = size * rng.choice([-1e-3, -1e-6, 1e-6, 1e-3], size=(len(n1), 1))
    o = np.concatenate([o, seen.p[good] + n1 * height - 2 * size * along])
    return o, np.concatenate([d, along]) * rng.uniform(0.2, 5, size=(len(o), 1))


def reference(example, o, d, t_min):
    """All roots of all pieces by dense sampling and bisection: t (rays, roots), how steep, and the margin there."""
    center, size = size_of(example.shape)
    speed = norm(d)
    middle = ((center - o) * d).sum(-1) / speed**2
    t = middle[:, None] + np.linspace(-1.5, 1.5, 402) * (size / speed)[:, None]
    found = []
    for piece in example.pieces:
        g = piece.g(o[:, None] + t[..., None] * d[:, None])
        ray, step = np.nonzero((g[:, :-1] < 0) != (g[:, 1:] < 0))
        a, b, below = t[ray, step], t[ray, step + 1], g[ray, step] < 0
        for _ in range(70):
            m = 0.5 * (a + b)
            left = (piece.g(o[ray] + m[:, None] * d[ray]) < 0) == below
            a, b = np.where(left, m, a), np.where(left, b, m)
        p, h = o[ray] + a[:, None] * d[ray], 1e-6 * size
        n = d[ray] / speed[ray][:, None]
        slope = np.abs(piece.g(p + h * n) - piece.g(p - h * n)) / (2 * h)
        keep = a > t_min[ray] + 1e-9 * size / speed[ray]
        found.append(np.stack([ray, a, slope, piece.margin(p)])[:, keep])
    return np.concatenate(found, axis=1)


def closest_piece(example, p):
    """Index of the piece that each point lies on, and how far off it is."""
    _, size = size_of(example.shape)
    g = np.stack([np.where(piece.margin(p) > -1e-9 * size, np.abs(piece.g(p)), np.inf) for piece in example.pieces])
    return g.argmin(axis=0), g.min(axis=0)


def gradient(g, p, h):
    return np.stack([(g(p + h * e) - g(p - h * e)) / (2 * h) for e in np.eye(3)], axis=-1)


def test_there_are_examples_of_every_shape():
    assert set(EXAMPLES) == set(members("shapes"))


@pytest.mark.parametrize("example", ALL)
def test_the_normal_alone_is_that_of_the_surface_and_flat_primitives_have_one(example):
    """Labels compute it once for what is flat."""
    seen = Traced(example.shape, *rays_for(example.shape))
    np.testing.assert_array_equal(seen.facing[seen.hit], seen.normal[seen.hit])
    if type(example.shape).flat:
        for primitive in np.unique(seen.prim[seen.hit]):
            normals = seen.normal[seen.hit & (seen.prim == primitive)]
            np.testing.assert_array_equal(normals, np.broadcast_to(normals[0], normals.shape))


@pytest.mark.parametrize("example", ALL)
def test_hits_are_the_roots_of_an_independent_definition(example):
    """First and second hits: on the surface, in bounds, oriented; none missed. `occluded` agrees."""
    shape = example.shape
    center, size = size_of(shape)
    o, d = rays_for(shape)
    o, d = np.concatenate([o, o]), np.concatenate([d, d])
    t_min = np.zeros(len(o))
    half = len(o) // 2
    first = Traced(shape, o[:half], d[:half])
    t_min[half:] = np.where(first.hit, first.t, 0)
    seen = Traced(shape, o, d, t_min)
    assert seen.hit.sum() > 100
    assert (seen.hit == seen.dark).all()
    assert (seen.t > t_min).all()

    # Every hit lies on the surface: no false roots. Far eyes round the point itself.
    p, hit = seen.p[seen.hit], seen.hit
    piece, off = closest_piece(example, p)
    slack = example.tolerance * size + 4e-16 * (norm(o[hit] - center) + norm(p - center))
    slopes = np.stack([norm(gradient(q.g, p, 1e-6 * size)) for q in example.pieces])[piece, np.arange(len(p))]
    assert (off <= slack * np.maximum(slopes, 1)).all(), (off / slack).max()
    lower, upper = shape.bounds()
    assert ((p >= lower - slack[:, None]) & (p <= upper + slack[:, None])).all()

    # Normals point along the definition's gradient: outward.
    normal = seen.normal[hit] / norm(seen.normal[hit])[:, None]
    g = np.stack([gradient(q.g, p, 1e-6 * size) for q in example.pieces])[piece, np.arange(len(p))]
    clear = (slopes > 1e-2) & (norm(p - center) < 10 * size)
    cosine = (normal * g).sum(-1)[clear] / slopes[clear]
    assert (cosine > 1 - 1e-6).mean() > 0.97, "all but a few hits that lie on creases"
    assert (np.abs(norm(seen.shading[hit])) > 0).all()

    # No root is missed, unless rounding decides: it grazes, or lies on the rim.
    ray, t, slope, margin = reference(example, o, d, t_min)
    ray, speed = ray.astype(int), norm(d)
    late = (seen.t[ray] - t) * speed[ray] > 1e-7 * size + 1e-11 * norm(o[ray] - center)
    sure = (slope > example.grazing) & (margin > 1e-9 * size)
    assert sure.sum() > 100
    assert not (late & sure).any(), np.nonzero(late & sure)


@pytest.mark.parametrize("example", [e for e in ALL if e.values[0].closed])
def test_closed_shapes_are_left_as_often_as_entered(example):
    """Along a ray through a closed surface, normals face the ray and look away from it in turn."""
    center, size = size_of(example.shape)
    rng = np.random.default_rng(3)
    o = center + 4 * size * rng.normal(size=(300, 3))
    d = center + 0.4 * size * rng.normal(size=(300, 3)) - o
    t = np.zeros(300)
    inside = np.zeros(300, bool)
    for _ in range(6):
        seen = Traced(example.shape, o, d, t)
        facing = (seen.normal * d).sum(-1)
        sure = seen.hit & (np.abs(facing) > 1e-6 * norm(seen.normal) * norm(d))
        assert ((facing > 0) == inside)[sure].all()
        inside ^= seen.hit
        t = np.where(seen.hit, seen.t, t)
    assert not inside.any()


@pytest.mark.parametrize("example", ALL)
def test_neighbouring_hits_agree_with_normal_tangent_and_uv(example):
    """Finite differences: the points around lie across the normal; u grows along the tangent, v does not."""
    shape = example.shape
    _, size = size_of(shape)
    o, d = rays_for(shape, 60, easy=True)
    seen = Traced(shape, o, d)
    keep = seen.hit & (norm(o - seen.p) < 20 * size)
    p, n, tangent = seen.p[keep], seen.normal[keep], seen.tangent[keep]
    n, side = n / norm(n)[:, None], tangent / norm(tangent)[:, None]
    assert np.allclose((n * side).sum(-1), 0, atol=1e-6)
    h = 1e-5 * size

    def land(offset):
        return Traced(shape, p + offset + h * n, -n, 0, 2 * h)

    ahead, behind, across = land(h * side), land(-h * side), land(h * np.cross(n, side))
    same = [x.hit & (x.prim == seen.prim[keep]) & ((x.normal * n).sum(-1) > 0.99 * norm(x.normal))
            for x in (ahead, behind, across)]  # fmt: skip
    both = same[0] & same[1]
    assert both.mean() > 0.8
    assert np.allclose(((ahead.p - p) * n).sum(-1)[same[0]], 0, atol=0.05 * h)
    assert np.allclose(((across.p - p) * n).sum(-1)[same[2]], 0, atol=0.05 * h)
    du = (ahead.u - behind.u)[both]
    du -= np.round(du) if du.size and np.abs(seen.u[seen.hit]).max() <= 1 else 0
    assert (du > 0).mean() > 0.98
    # The tangent is the derivative by u, except where a surface bends too much for differences.
    assert np.quantile(np.abs(du * norm(tangent)[both] / (2 * h) - 1), 0.9) < 1e-3
    dv = np.abs(ahead.v - behind.v)[both]
    assert np.quantile(dv, 0.95) < 1e-3 * np.quantile(du, 0.95)
    if type(shape).__name__ not in ("Plane", "Polygon"):  # these measure metres
        assert ((seen.u >= 0) & (seen.u <= 1) & (seen.v >= 0) & (seen.v <= 1))[seen.hit].all()


@pytest.mark.parametrize("example", ALL)
@pytest.mark.parametrize("mirror", [1, -1])
def test_transforms_carry_hits_and_normals(example, mirror):
    shape = example.shape
    move = Transform.translate(3, -2, 1) @ Transform.rotate((1, 2, -1), 40) @ Transform.scale(1.5, 0.7, mirror * 2)
    o, d = rays_for(shape, 60, easy=True)
    o, d = o[(d != 0).all(axis=1)], d[(d != 0).all(axis=1)]
    here, there = Traced(shape, o, d), Traced(shape, move.point(o), move.direction(d), transform=move)
    both = here.hit & there.hit
    assert (here.hit == there.hit).all()
    steep = np.abs((here.normal * d).sum(-1)) > 1e-2 * norm(here.normal) * norm(d)
    assert np.allclose(here.t[both & steep], there.t[both & steep], rtol=1e-9, atol=1e-9)
    n, expected = there.normal[both & steep], move.normal(here.normal[both & steep])
    assert np.allclose(norm(np.cross(n, expected)), 0, atol=1e-6 * (norm(n) * norm(expected)).max())
    assert ((n * expected).sum(-1) > 0).all()
    assert np.allclose(there.tangent[both & steep], move.direction(here.tangent[both & steep]), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("example", ALL)
def test_limits_are_strict_and_kept(example):
    o, d = rays_for(example.shape, 40)
    t = Traced(example.shape, o, d).t
    hit = np.isfinite(t)
    o, d, t = o[hit], d[hit], t[hit]
    assert not Traced(example.shape, o, d, 0, t).hit.any()
    assert (Traced(example.shape, o, d, 0, np.nextafter(t, np.inf)).t == t).all()
    assert (Traced(example.shape, o, d, np.nextafter(t, -np.inf)).t == t).all()
    assert (Traced(example.shape, o, d, t).t > t).all()


@pytest.mark.parametrize("example", ALL)
def test_machine_code_and_python_agree(example):
    o, d = rays_for(example.shape, 30, easy=True)
    o, d = o[::3], d[::3]
    fast, slow = Traced(example.shape, o, d), Traced(example.shape, o, d, compiled=False)
    steep = np.abs((slow.normal * d).sum(-1)) > 1e-3 * norm(slow.normal) * norm(d)
    both = fast.hit & slow.hit & steep
    assert (fast.hit == slow.hit).all()
    assert both.sum() > 12
    assert np.allclose(fast.t[both], slow.t[both], rtol=1e-11, atol=1e-13)
    for name, tolerance in (("u", 1e-6), ("v", 1e-6), ("normal", 1e-6), ("shading", 1e-6), ("tangent", 1e-6)):
        difference = np.abs(getattr(fast, name) - getattr(slow, name))[both]
        assert (difference - (np.round(difference) if name == "u" else 0) < tolerance).all(), name


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("example", ALL)
def test_rays_that_are_none_miss(example, compiled):
    nan = np.nan
    o = np.array([[0, 0, 0], [0.1, 0.2, 0.3], [nan, 0, 0], [0, 0, nan], [3, 3, 3], [3, 3, 3], [0, 0, 0]], float)
    d = np.array([[0, 0, 0], [0, 0, 0], [1, 1, 1], [0, 1, 0], [nan, -1, -1], [-1, -1, nan], [nan, nan, nan]], float)
    seen = Traced(example.shape, o, d, compiled=compiled)
    assert not seen.hit.any()
    assert not seen.dark.any()


def test_torus_hits_are_exact_even_for_thin_rings_and_far_eyes():
    """Residual at most 1e-10 of the size, through the hole, grazing, and from 1e4 sizes away."""
    for example in EXAMPLES["Torus"]:
        o, d = rays_for(example.shape, 2000)
        seen = Traced(example.shape, o, d)
        assert np.abs(example.pieces[0].g(seen.p[seen.hit])).max() < 1e-10


def test_rays_through_a_box_edge_or_corner_are_caught():
    shape = EXAMPLES["Box"][0].shape
    corners = np.array(list(itertools.product(*zip(shape.lower, shape.upper, strict=True))))
    o = np.tile([3.0, 4.0, 5.0], (8, 1))
    inner = Traced(shape, o, corners + 1e-9 * (np.mean(corners, axis=0) - corners) - o)
    assert inner.hit.all()


def test_rims_of_capped_bodies_have_no_gap():
    """Rays to points on the rim, an instant inside, never slip between side and cap."""
    angle = np.random.default_rng(1).uniform(0, 2 * np.pi, 2000)
    for name in ("Cylinder", "Cone"):
        for example in EXAMPLES[name]:
            if example.closed:
                shape = example.shape
                axis_u, axis_v, _ = shape.axes()
                r = shape.radii()[0]
                rim = shape.base + r * (np.cos(angle)[:, None] * axis_u + np.sin(angle)[:, None] * axis_v)
                inside = rim + 1e-13 * (0.5 * (np.array(shape.base) + shape.top) - rim)
                o = np.array([4.0, 3.0, -5.0])
                through = Traced(shape, np.tile(o, (2000, 1)), inside - o, 0, np.inf)
                assert through.hit.mean() > 0.999


WRONG = [
    ("Box", {"lower": (0, 0, 0), "upper": (1, 0, 1)}, "Box.upper"),
    ("Disk", {"radius": 1, "inner_radius": 1}, "Disk.inner_radius"),
    ("Rectangle", {"edge_u": (1, 1, 0), "edge_v": (2, 2, 0)}, "Rectangle.edge_v"),
    ("Triangle", {"a": (0, 0, 0), "b": (1, 0, 0), "c": (2, 0, 0)}, "Triangle.c"),
    ("Cylinder", {"base": (1, 1, 1), "top": (1, 1, 1)}, "Cylinder.top"),
    ("Cone", {"base_radius": 0}, "Cone.base_radius"),
    ("Quadric", {"j": 1}, "Quadric.a"),
    ("Torus", {"minor_radius": 2}, "Torus.minor_radius"),
    ("Polygon", {"outline": [(0, 0, 0), (1, 0, 0)]}, "Polygon.outline"),
    ("Polygon", {"outline": [(0, 0, 0), (1, 0, 0), (1, 1, 0.1), (0, 1, 0)]}, "off the plane"),
    ("Polygon", {"outline": [(0, 0, 0), (1, 0, 0), (2, 0, 0)]}, "no area"),
    ("Mesh", {"vertices": np.eye(3), "faces": [(0, 1, 3)]}, "Mesh.faces: row 0"),
    ("Mesh", {"vertices": np.eye(3), "faces": [(0, 1, 2)], "uvs": [(0, 0)]}, "Mesh.uvs"),
    ("Mesh", {"vertices": np.eye(3), "faces": [(0, 1, 1)]}, "none with an area"),
    ("Implicit", {}, "either an expression or a function"),
    ("Implicit", {"function": lambda x, y, z: x}, "@kernel"),
    ("Plane", {"normal": (0, 0, 0)}, "Plane.normal"),
]


@pytest.mark.parametrize(("name", "values", "message"), WRONG)
def test_wrong_values_are_refused(name, values, message):
    with pytest.raises(SceneError, match=message):
        members("shapes")[name](**values)


# ------------------------------------------------------------------------------------------------- quadric, polygon, mesh


def test_named_quadrics_keep_their_formulas():
    make = members("shapes")["Quadric"]
    o, d = np.array([[0.0, 5, 0]]), np.array([[0.0, -1, 0]])
    cases = [
        (make.ellipsoid((1, 0.5, 1)), 4.5), (make.ellipsoid((1, 0.5, 1), center=(0, 1, 0)), 3.5),
        (make.paraboloid(height=2), 5), (make.hyperboloid_of_two_sheets((1, 0.7, 1), height=3), 4.3),
    ]  # fmt: skip
    for shape, t in cases:
        assert Traced(shape, o, d, transform=shape.transform).t[0] == pytest.approx(t, abs=1e-12)
    waist = make.hyperboloid((0.5, 1, 2))
    side = Traced(waist, np.array([[3.0, 0, 0], [0, 0, 5]]), np.array([[-1.0, 0, 0], [0, 0, -1]]))
    assert side.t == pytest.approx([2.5, 3])
    for wrong in ((make.paraboloid, {"height": 0}), (make.ellipsoid, {"radii": (1, -1, 1)}),
                  (make.hyperboloid_of_two_sheets, {"radii": (1, 2, 1), "height": 4})):  # fmt: skip
        with pytest.raises(SceneError, match=r"Quadric\."):
            wrong[0](**wrong[1])


def test_polygon_edges_belong_to_it_and_neighbours_leave_no_gap():
    make = members("shapes")["Polygon"]
    square = make(outline=[(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], holes=[[(0.5, 0.5, 0), (1, 0.5, 0), (1, 1, 0)]])
    on = [(0, 0), (2, 2), (1, 0), (2, 1), (0, 2), (0.75, 0.5), (0.75, 0.75), (1, 1), (1.5, 0.5), (0.2, 1), (0.2, 0.5)]
    off = [(0.9, 0.6), (-1e-12, 1), (2 + 1e-12, 1), (1, 2 + 1e-12), (3, 0), (-1, 2), (-1, 1), (-1, 0), (3, 2)]
    for points, inside in ((on, True), (off, False)):
        o = np.column_stack([points, np.ones(len(points))])
        assert (Traced(square, o, np.tile([0.0, 0, -1], (len(o), 1))).hit == inside).all()

    # Two triangles share an edge, in one plane or folded: rays to it from anywhere hit one or the other.
    rng = np.random.default_rng(2)
    q, u, v = rng.normal(size=(3, 3))
    aim = q + u + rng.uniform(0.001, 0.999, (5000, 1)) * (v - u)
    for fold in (0, 0.7):
        left, right = make(outline=[q, q + u, q + v]), make(outline=[q + u, q + u + v + fold * np.cross(u, v), q + v])
        d = aim - (q - np.cross(u, v) * 4 + rng.normal(size=(5000, 3)))
        both = ((d @ left.area()) > 0) == ((d @ right.area()) > 0)  # else the edge is an outline, and rays may pass it
        assert both.sum() > 4000
        assert (Traced(left, aim - d, d).hit | Traced(right, aim - d, d).hit)[both].all()


def test_mesh_drops_triangles_without_area_and_ignores_strays():
    make = members("shapes")["Mesh"]
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0), (1e9, 1e9, 1e9)]
    with pytest.warns(UserWarning, match="2 triangles without area"):
        mesh = make(vertices=vertices, faces=[(0, 1, 1), (0, 1, 2), (0, 1, 3)])
    assert mesh.dropped == 2
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert mesh.bounds()[1].tolist() == [1, 1, 0]
    assert mesh.tree() is mesh.tree()
    assert Traced(mesh, np.array([[0.25, 0.25, 1]]), np.array([[0, 0, -2.0]])).t == [0.5]
    assert make(vertices=vertices, faces=mesh.faces).dropped == 0


def test_corners_on_one_line_have_no_area_whatever_its_direction():
    rng = np.random.default_rng(3)
    start, along = rng.integers(-8, 8, (200, 3)), rng.integers(1, 9, (200, 3)) * rng.choice([-1, 1], (200, 3))
    on_a_line = start[:, None] + along[:, None] * np.array([[0], [1], [3]])  # whole numbers: exactly
    thin = on_a_line + np.array([[0, 0, 0], [1e-9, -1e-9, 2e-9], [0, 0, 0]])
    vertices = np.concatenate([on_a_line, thin]).reshape(-1, 3)
    with pytest.warns(UserWarning, match="200 triangles without area"):
        mesh = members("shapes")["Mesh"](vertices=vertices, faces=np.arange(1200).reshape(-1, 3))
    assert mesh.dropped == 200
    assert mesh.faces[:, 0].tolist() == list(range(600, 1200, 3))


def test_mesh_shading_interpolates_normals_and_uvs():
    example = EXAMPLES["Mesh"][1]
    o, d = rays_for(example.shape, 40, easy=True)
    seen = Traced(example.shape, o, d)
    p = seen.p[seen.hit]
    radial = p / norm(p)[:, None]
    assert ((seen.shading[seen.hit] * radial).sum(-1) / norm(seen.shading[seen.hit]) > 0.999).all()  # phong of a ball
    expected = 0.5 + p @ np.array([[0.2, 0.05], [-0.1, 0.2], [0.07, -0.1]])
    assert np.allclose(np.stack([seen.u, seen.v], axis=1)[seen.hit], expected)
