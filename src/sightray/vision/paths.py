"""Paths of sight by mirrors and through glass: what is seen in them, and how that flows.

The first surface throws the ray back (`MIRRORED`) or lets it through (`REFRACTED`); from then on, the path is the one
that carries most: through glass as long as it lets anything pass, off surfaces that are more mirror than matte, to the
first that is neither. Flow solves for the pixel whose path, by the same surfaces, leads to the same material point.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sightray._jit import kernel
from sightray.accelerators.item import MOVED, MOVING, ItemHit, item_at
from sightray.bvh.bvh8 import int_at
from sightray.cameras.base import sight_ray
from sightray.integrators.shading import first_step
from sightray.materials.base import local
from sightray.mathlib.frame import reflect, refract
from sightray.mathlib.rng import stream
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, f64_put, i64_at, i64_put, table_at, vec3_put
from sightray.mathlib.vec import Vec3, max3, normalize
from sightray.scene.crossings import MESH
from sightray.scene.parallel import run_chunks
from sightray.scene.query_kernels import exact_hit, hit_point
from sightray.scene.world import ITEMS, find_closest, on_seen_side, point_of, thin_beam
from sightray.vision.record import CAMERA, KINDS, PATH_NAMES, WORLD

NO_WAY, MIRRORED, REFRACTED = 0, 1, 2  # how a path goes on at a surface
MOST = 32  # surfaces on the way

# Words of a path's end: the last ray, what it met, how the path came there.
ORIGIN, DIRECTION, POSITION, T, ITEM, PRIM, U, V, WAY = 0, 4, 8, 12, 13, 14, 15, 16, 17
END_WORDS = 24


class PathEnds(NamedTuple):
    """Ends of paths, a row each."""

    origin: np.ndarray  # (n, 3) of the last ray
    direction: np.ndarray  # (n, 3)
    position: np.ndarray  # (n, 3) that it met; NaN for nothing
    item: np.ndarray  # (n,) -1 for nothing
    primitive: np.ndarray  # (n,)
    weights: np.ndarray  # (n, 2) barycentric, on meshes
    way: np.ndarray  # (n,) names the surfaces on the way; 0 where the first is no mirror (or glass)


@kernel
def way_on(mirror: Vec3, transmission: Vec3, diffuse: Vec3, wanted: i64) -> i64:
    """How a path goes on; `wanted` at the first surface, NO_WAY for what carries most."""
    if wanted == MIRRORED:
        return MIRRORED if max3(mirror) > 0.0 else NO_WAY
    if max3(transmission) > 0.0:
        return REFRACTED
    if wanted == NO_WAY and max3(mirror) > 3.0 * max3(diffuse):  # diffuse is per steradian, about a third of an albedo
        return MIRRORED
    return NO_WAY


@kernel
def trace_path(frame: Table, x: f64, y: f64, first: i64, end: Table) -> None:
    """Follow one path to its end."""
    world, kinds, names = table_at(frame, WORLD), table_at(frame, KINDS), table_at(frame, PATH_NAMES)
    ray = sight_ray(table_at(frame, CAMERA), x, y, 0.5, 0.5, 0.5)
    o, d, t_min, way, wanted = ray.origin, ray.direction, 0.0, 0, first
    hit = find_closest(world, o, d, t_min, math.inf)
    for _ in range(MOST):
        if hit.item < 0:
            break
        point = on_seen_side(point_of(world, hit, o, d, thin_beam()), d)
        terms = local(point.material, point.where, point.cos_view)
        how = way_on(terms.mirror, terms.transmission, terms.diffuse, wanted)
        if how == NO_WAY:
            break
        facing = point.shading if point.cos_view >= 0.0 else -point.shading
        d = normalize(reflect(d, facing)) if how == MIRRORED else refract(d, facing, terms.eta)
        o, t_min = point.p, first_step(math.nan, point.p, hit.t)
        way = stream(way, 4 * int_at(names, hit.item) + how)
        wanted = NO_WAY
        hit = find_closest(world, o, d, t_min, math.inf)

    # Describe the end; where what moves is depends on the time, which only rays know.
    position = Vec3(math.nan, math.nan, math.nan)
    if hit.item >= 0 and i64_at(item_at(table_at(world, ITEMS), hit.item), MOVED) == MOVING:
        position = o + d * hit.t
    elif hit.item >= 0:
        if int_at(kinds, hit.item) == MESH:
            hit = exact_hit(world, kinds, hit, o, d)
        position = hit_point(world, kinds, hit, o, d)
    put_end(end, o, d, position, hit, way)


@kernel
def put_end(end: Table, o: Vec3, d: Vec3, position: Vec3, hit: ItemHit, way: i64) -> None:
    """Write the end of a path."""
    vec3_put(end, ORIGIN, o)
    vec3_put(end, DIRECTION, d)
    vec3_put(end, POSITION, position)
    f64_put(end, T, hit.t)
    i64_put(end, ITEM, hit.item)
    i64_put(end, PRIM, hit.prim)
    f64_put(end, U, hit.u)
    f64_put(end, V, hit.v)
    i64_put(end, WAY, way)


@kernel
def trace_paths(frame: Table, pixels: Table, first: i64, last: i64, how: i64, ends: Table, stop: Table) -> None:
    """Follow the paths through pixel coordinates number `first` to ``last - 1``."""
    for i in range(first, last):
        if i & 255 == 0 and i64_at(stop, 0) != 0:
            return
        trace_path(frame, f64_at(pixels, 2 * i), f64_at(pixels, 2 * i + 1), how, advance(ends, i * END_WORDS))


def path_ends(frame: Any, pixels: np.ndarray, how: int, names: np.ndarray | None = None) -> PathEnds:
    """Ends of the paths through pixel coordinates, (n, 2). `names` calls the items on the way what they are called in
    another scene, so that ways can be compared."""
    row, space = frame.row(names=names)
    run = frame.kernel(trace_paths)
    pixels = np.ascontiguousarray(pixels, np.float64)
    ends = np.empty((len(pixels), END_WORDS))
    inputs, outputs = space.array(pixels), space.array(ends)

    def work(first: int, last: int, stop: Table) -> None:
        run(row, inputs, first, last, how, outputs, stop)

    run_chunks(len(pixels), work, frame.threads)
    whole = ends.view(np.int64)
    return PathEnds(
        ends[:, ORIGIN : ORIGIN + 3], ends[:, DIRECTION : DIRECTION + 3], ends[:, POSITION : POSITION + 3],
        whole[:, ITEM], whole[:, PRIM], ends[:, U : V + 1], whole[:, WAY],
    )  # fmt: skip
