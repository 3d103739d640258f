"""Where a point keeps its brightness from one picture to the next, and why it does not.

Light towards the camera is taken apart at the same material point in both pictures: what shines by itself and by ambient
light, what is mirrored, what is refracted, and for each light its diffuse and its specular part without shadows, times
the share V that arrives. Of a light with unshadowed part a, the change ``a1 V1 - a0 V0`` is ``(a1 - a0) V1``, the surface
turning, plus ``a0 (V1 - V0)``, the shadow. Lights with an area are asked at the middles of their cells, so there is no
noise.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sightray._jit import kernel
from sightray.cameras.base import Ray, sight_ray
from sightray.integrators.base import radiance
from sightray.integrators.whitted import reflected
from sightray.lights.base import cells, illuminate
from sightray.mathlib.frame import reflect, refract
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import (
    Table,
    advance,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    scratch,
    table_at,
    vec3_at,
    vec3_put,
)
from sightray.mathlib.vec import Vec3, dot, grey, max3, normalize
from sightray.scene.parallel import run_chunks
from sightray.scene.world import AMBIENT, background, find_closest, lamp_count, light_at
from sightray.vision import record as words
from sightray.vision.lighting import Seen, draws_at, seen_at, share_passed

FIXED, MIRROR, THROUGH, ITEM, LIGHTS = 0, 4, 8, 12, 16  # words of a row; then for each light:
MATTE, SHINE, SEEN, BEFORE = 0, 4, 8, 9
LIGHT_WORDS = 12


class Shading(NamedTuple):
    """Light towards the camera from n points, taken apart."""

    fixed: np.ndarray  # (n, 3) emission and ambient light; the background where nothing is
    mirror: np.ndarray  # (n, 3)
    through: np.ndarray  # (n, 3)
    item: np.ndarray  # (n,)
    matte: np.ndarray  # (n, lights, 3) without shadows
    shine: np.ndarray  # (n, lights, 3) without shadows
    seen: np.ndarray  # (n, lights) share of what would arrive that does
    before: np.ndarray  # (n, lights) share of the cells that lie before the surface

    def color(self) -> np.ndarray:
        """All of it together, (n, 3)."""
        lit = ((self.matte + self.shine) * self.seen[..., None]).sum(axis=1)
        return self.fixed + self.mirror + self.through + lit


@kernel
def shade_pixel(frame: Table, x: f64, y: f64, row: Table) -> None:
    """Take apart the light along the ray through pixel coordinates."""
    world, integrator, record = table_at(frame, words.WORLD), table_at(frame, words.INTEGRATOR), scratch(32)
    ray = sight_ray(table_at(frame, words.CAMERA), x, y, 0.5, 0.5, 0.5)
    hit = find_closest(world, ray.origin, ray.direction, 0.0, 1e300)
    i64_put(row, ITEM, hit.item)
    vec3_put(row, MIRROR, grey(0.0))
    vec3_put(row, THROUGH, grey(0.0))
    if hit.item < 0:
        vec3_put(row, FIXED, background(world, ray.direction))
        return
    vec3_put(record, words.ORIGIN, ray.origin)
    vec3_put(record, words.DIRECTION, ray.direction)
    f64_put(record, words.T, hit.t)
    i64_put(record, words.ITEM, hit.item)
    i64_put(record, words.PRIM, hit.prim)
    f64_put(record, words.U, hit.u)
    f64_put(record, words.V, hit.v)
    f64_put(record, words.X, x)
    f64_put(record, words.Y, y)

    # What shines by itself, what is mirrored, what comes through.
    seen, draws = seen_at(frame, record), draws_at(frame, record)
    terms, d, p = seen.terms, ray.direction, seen.point.p
    vec3_put(row, FIXED, terms.emission + terms.ambient * vec3_at(world, AMBIENT))
    if max3(terms.mirror) > 0.0:
        away = normalize(reflect(d, seen.n))
        found = radiance(integrator, world, Ray(p + away * seen.step, away), draws)
        vec3_put(row, MIRROR, terms.mirror * found.color)
    if max3(terms.transmission) > 0.0:
        away = refract(d, seen.n if dot(seen.n, d) < 0.0 else -seen.n, terms.eta)
        found = radiance(integrator, world, Ray(p + away * seen.step, away), draws)
        vec3_put(row, THROUGH, terms.transmission * found.color)
    for index in range(lamp_count(world)):
        shade_by_light(frame, light_at(world, index), seen, d, advance(row, LIGHTS + index * LIGHT_WORDS))


@kernel
def shade_by_light(frame: Table, light: Table, seen: Seen, d: Vec3, row: Table) -> None:
    """What one light adds: both parts without shadows, and the share that arrives."""
    p = seen.point.p
    matte, shine, whole, arrived, before = grey(0.0), grey(0.0), 0.0, 0.0, 0
    count = cells(light)
    for cell in range(count):
        sample = illuminate(light, p, cell, 0.5, 0.5)
        cosine = dot(seen.n, sample.direction)
        answer = reflected(seen.terms, seen.n, d, sample.direction) * sample.irradiance
        diffuse = seen.terms.diffuse * max(cosine, 0.0) * sample.irradiance
        matte += diffuse
        shine += answer - diffuse
        if cosine > 0.0:
            before += 1
        if max3(answer) > 0.0:
            passed = share_passed(frame, seen, sample)
            whole += max3(answer)
            arrived += max3(answer * passed)
    vec3_put(row, MATTE, matte)
    vec3_put(row, SHINE, shine)
    f64_put(row, SEEN, arrived / whole if whole > 0.0 else 1.0)
    f64_put(row, BEFORE, before / count)


@kernel
def shade_pixels(frame: Table, pixels: Table, first: i64, last: i64, size: i64, rows: Table, stop: Table) -> None:
    """Take apart the light along the rays number `first` to ``last - 1``; rows of `size` words."""
    for i in range(first, last):
        if i & 255 == 0 and i64_at(stop, 0) != 0:
            return
        shade_pixel(frame, f64_at(pixels, 2 * i), f64_at(pixels, 2 * i + 1), advance(rows, i * size))


def shade(frame: Any, pixels: np.ndarray) -> Shading:
    """Take apart the light along the rays through pixel coordinates, (n, 2)."""
    lights = len(frame.view.scene.lights)
    row, space = frame.row()
    run = frame.kernel(shade_pixels)
    size = LIGHTS + LIGHT_WORDS * lights
    rows = np.zeros((len(pixels), size))
    inputs, outputs = space.array(np.ascontiguousarray(pixels, np.float64)), space.array(rows)

    def work(first: int, last: int, stop: Table) -> None:
        run(row, inputs, first, last, size, outputs, stop)

    run_chunks(len(pixels), work, frame.threads)
    by_light = rows[:, LIGHTS:].reshape(-1, lights, LIGHT_WORDS)
    return Shading(
        rows[:, :3], rows[:, MIRROR : MIRROR + 3], rows[:, THROUGH : THROUGH + 3], rows.view(np.int64)[:, ITEM],
        by_light[..., :3], by_light[..., SHINE : SHINE + 3], by_light[..., SEEN], by_light[..., BEFORE],
    )  # fmt: skip
