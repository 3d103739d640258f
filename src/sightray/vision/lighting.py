"""Light at the points that are seen, in Whitted's terms (see `materials.base`): for the layers about light and material."""

from __future__ import annotations

from typing import NamedTuple

from sightray._jit import kernel
from sightray.accelerators.item import MOVED, MOVING, ItemHit, item_at
from sightray.bvh.bvh8 import int_at
from sightray.cameras.base import APART, SPREAD
from sightray.integrators.shading import first_step
from sightray.integrators.terminator import lifted, shadow_ray
from sightray.integrators.whitted import OFFSET, SHADOWS, TWO_SIDED, transmitted
from sightray.lights.base import LightSample, cells, illuminate
from sightray.materials.base import Local, local
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, no_table, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, max3
from sightray.samplers.base import Draws, begin, nested, pair
from sightray.scene.crossings import MESH
from sightray.scene.query_kernels import exact_hit
from sightray.scene.world import ITEMS, Beam, Point, is_blocked, lamp_count, light_at, on_seen_side, point_of
from sightray.vision.record import (
    CAMERA,
    DIRECTION,
    INTEGRATOR,
    ITEM,
    KINDS,
    ORIGIN,
    PRIM,
    SAMPLER,
    WORLD,
    T,
    U,
    V,
    X,
    Y,
)


class Seen(NamedTuple):
    """A point that is seen, and how its surface answers light."""

    point: Point
    terms: Local
    start: Vec3  # where `Whitted` lets shadow rays begin
    step: f64  # how far along them
    n: Vec3  # shading normal, on the side that is lit


@kernel
def seen_at(frame: Table, record: Table) -> Seen:
    """The point that a pixel's ray met, as `Whitted` shades it. For records with a hit."""
    world, kinds, index = table_at(frame, WORLD), table_at(frame, KINDS), i64_at(record, ITEM)
    o, d, u = vec3_at(record, ORIGIN), vec3_at(record, DIRECTION), f64_at(record, U)
    hit = ItemHit(f64_at(record, T), index, i64_at(record, PRIM), u, f64_at(record, V))
    moving = i64_at(item_at(table_at(world, ITEMS), index), MOVED) == MOVING
    if not moving and (int_at(kinds, index) == MESH or u != u):
        hit = exact_hit(world, kinds, hit, o, d)
    camera = table_at(frame, CAMERA)
    beam = Beam(f64_at(camera, APART), f64_at(camera, SPREAD), no_table())
    point = point_of(world, hit, o, d, beam)
    start, n, integrator = point.p, point.shading, table_at(frame, INTEGRATOR)
    if i64_at(integrator, TWO_SIDED) != 0:
        point = on_seen_side(point, d)
        start = lifted(world, hit, point)
        n = point.shading if point.cos_view >= 0.0 else -point.shading
    terms = local(point.material, point.where, point.cos_view)
    return Seen(point, terms, start, first_step(f64_at(integrator, OFFSET), point.p, hit.t), n)


@kernel
def draws_at(frame: Table, record: Table) -> Draws:
    """The random numbers of a picture's only sample of a pixel, with seed 0."""
    return nested(begin(table_at(frame, SAMPLER), int(f64_at(record, X)), int(f64_at(record, Y)), 0, 0, 1), 0)


@kernel
def share_passed(frame: Table, seen: Seen, sample: LightSample) -> Vec3:
    """Share of a light's light that arrives, as `Whitted` has it."""
    integrator = table_at(frame, INTEGRATOR)
    if i64_at(integrator, SHADOWS) == 0:
        return grey(1.0)
    way = shadow_ray(seen.start, seen.point.p, sample.direction, sample.distance)
    return transmitted(integrator, table_at(frame, WORLD), way.o, way.d, seen.step, way.distance)


@kernel
def irradiance_at(frame: Table, record: Table, seen: Seen) -> Vec3:
    """Light that arrives straight from all lights, per area; with the shadow rays of a picture of one sample."""
    world = table_at(frame, WORLD)
    own = nested(draws_at(frame, record), 0)
    total, dimension = grey(0.0), 0
    for index in range(lamp_count(world)):
        light = light_at(world, index)
        for cell in range(cells(light)):
            place = pair(own, dimension)
            dimension += 1
            sample = illuminate(light, seen.point.p, cell, place.u, place.v)
            arriving = sample.irradiance * max(0.0, dot(seen.n, sample.direction))
            if max3(arriving) > 0.0:
                total += arriving * share_passed(frame, seen, sample)
    return total


class Shares(NamedTuple):
    """Of a light's light, without shadows, at a point: which share is seen, and which comes from before the surface."""

    seen: f64
    before: f64


@kernel
def shares_of_light(frame: Table, light: Table, seen: Seen, sight: Vec3, rays: i64) -> Shares:
    """Ask `rays` x `rays` points in the middles of the parts of each of the light's cells.

    Before the surface is on the side that faces the ray of direction `sight`. Points count by what they bring to a
    surface that faces them; evenly, where the light does not shine at all.
    """
    world, count = table_at(frame, WORLD), cells(light)
    facing = -1.0 if dot(seen.point.normal, sight) > 0.0 else 1.0
    total, shown, before, n_seen, n_before = 0.0, 0.0, 0.0, 0, 0
    for cell in range(count):
        for k in range(rays * rays):
            sample = illuminate(light, seen.point.p, cell, (k % rays + 0.5) / rays, (k // rays + 0.5) / rays)
            weight = max3(sample.irradiance)
            total += weight
            if facing * dot(seen.point.normal, sample.direction) > 0.0:
                n_before += 1
                before += weight
                if not is_blocked(world, seen.point.p, sample.direction, seen.step, sample.distance - seen.step):
                    n_seen += 1
                    shown += weight
    if total > 0.0:
        return Shares(shown / total, before / total)
    asked = float(count * rays * rays)
    return Shares(n_seen / asked, n_before / asked)
