"""Recursive ray tracing after Whitted."""

from __future__ import annotations

import math

from sightray._jit import implements, kernel
from sightray.cameras.base import Ray
from sightray.fields import flag, integer, number
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.notes import (
    ABSORPTION,
    AMBIENT,
    BACKGROUND,
    DIRECT,
    EMISSION,
    FLAT,
    MIRRORED,
    REFRACTED,
    SIGHT,
    note_hit,
    note_light,
    note_ray,
    note_term,
)  # fmt: skip
from sightray.integrators.shading import first_step
from sightray.integrators.terminator import lifted, shadow_ray
from sightray.lights.base import cells, illuminate
from sightray.materials.base import BLINN, Local, local
from sightray.mathlib.frame import reflect, refract
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import (
    Table,
    advance,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    no_table,
    scratch,
    vec3_at,
    vec3_put,
)
from sightray.mathlib.vec import Vec3, dot, grey, max3, normalize, vexp
from sightray.samplers.base import Draws, nested, pair
from sightray.scene.world import AMBIENT as WORLD_AMBIENT
from sightray.scene.world import (
    Point,
    background,
    find_closest,
    is_blocked,
    lamp_count,
    light_at,
    on_seen_side,
    point_of,
    sight_beam,
    thin_beam,
)

MAX_DEPTH = 200


class Whitted(Integrator):
    """Recursive ray tracing (T. Whitted, "An improved illumination model for shaded display", CACM 23(6), 1980).

    A ray of sight takes the nearest surface's local illumination, with a shadow ray to every light, and splits into a
    mirrored and a refracted ray, which do the same::

        I = emission + ambient + sum over lights of V L (diffuse + highlight)
            + mirror I_reflected + transmission I_refracted

    Recursion ends at `max_depth` bounces after the ray of sight, and where a ray's weight falls to `cutoff`. Each
    stage can be switched off, so that the five pictures of the classic lecture are five calls: ray casting
    (``illumination=shadows=reflections=refractions=False`` shows plain surface colours), local illumination, shadows,
    reflections, refractions.
    """

    max_depth: int = integer("bounces after the ray of sight", default=5, at_least=0, at_most=MAX_DEPTH)
    cutoff: float = number("rays that would weigh no more than this are not shot", default=1e-3, at_least=0)
    illumination: bool = flag("lights and ambient light; without it surfaces show their plain colour", default=True)
    shadows: bool = flag("shadow rays", default=True)
    reflections: bool = flag("mirrored rays", default=True)
    refractions: bool = flag("refracted rays", default=True)
    transparent_shadows: bool = flag("shadow rays pass through glass, dimmed and unbent", default=False)
    two_sided: bool = flag("surfaces are lit on the side that is seen, whichever it is", default=True)
    offset: float | None = number(
        "where secondary rays begin, along the ray; None takes 1e-9 of the size of the coordinates", default=None,
        at_least=0, unit="m", optional=True)  # fmt: skip


(
    DEPTH, CUTOFF, ILLUMINATION, SHADOWS, REFLECTIONS, REFRACTIONS, TRANSPARENT_SHADOWS, TWO_SIDED, OFFSET,
) = Whitted.offsets()  # fmt: skip

# Rays that wait on the stack: origin, direction, weight, then four single words. Each ray leaves at most two, and is
# taken off before, so the stack never holds more than one ray per level and the one that is being split.
WEIGHT, T_MIN, LEVEL, KIND, PARENT = 8, 12, 13, 14, 15
RAY_WORDS = 16
STACK_WORDS = (MAX_DEPTH + 2) * RAY_WORDS


@implements(radiance, Whitted)
def whitted_radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    stack = scratch(STACK_WORDS)
    waiting = push(stack, 0, ray.origin, ray.direction, grey(1.0), 0.0, 0, SIGHT, -1)
    color = grey(0.0)
    rays = 0
    number = -1  # of the ray of sight or one of its children
    while waiting > 0:
        # Take the ray that waits on top, and find what it meets.
        waiting -= 1
        number += 1
        top = advance(stack, waiting * RAY_WORDS)
        o, d, weight = vec3_at(top, 0), vec3_at(top, 4), vec3_at(top, WEIGHT)
        level = i64_at(top, LEVEL)
        note_ray(number, i64_at(top, PARENT), i64_at(top, KIND), o, d, weight)
        rays += 1
        hit = find_closest(world, o, d, f64_at(top, T_MIN), math.inf)
        if hit.item < 0:
            behind = background(world, d)
            note_term(number, BACKGROUND, behind)
            color += weight * behind
            continue

        # Light the point where it is seen; light lost inside glass on the way dims all that follows.
        point = point_of(world, hit, o, d, sight_beam(world, draws, no_table()))
        if i64_at(integrator, TWO_SIDED) != 0:
            point = on_seen_side(point, d)
        terms = local(point.material, point.where, point.cos_view)
        t_min = first_step(f64_at(integrator, OFFSET), point.p, hit.t)
        note_hit(number, hit.item, hit.t, point.p, point.shading)
        if max3(terms.absorption) > 0.0:
            left = vexp(terms.absorption * -hit.t)
            note_term(number, ABSORPTION, left)
            weight = weight * left
        start = lifted(world, hit, point) if i64_at(integrator, TWO_SIDED) != 0 else point.p
        lit = illuminated(integrator, world, point, start, terms, d, t_min, number, draws)
        color += weight * lit.color
        rays += lit.rays

        # Split into a refracted and a mirrored ray.
        if level >= i64_at(integrator, DEPTH):
            continue
        facing = point.shading if point.cos_view >= 0.0 else -point.shading
        passed = weight * terms.transmission
        if i64_at(integrator, REFRACTIONS) != 0 and max3(passed) > f64_at(integrator, CUTOFF):
            bent = refract(d, facing, terms.eta)
            waiting = push(stack, waiting, point.p, bent, passed, t_min, level + 1, REFRACTED, number)
        passed = weight * terms.mirror
        if i64_at(integrator, REFLECTIONS) != 0 and max3(passed) > f64_at(integrator, CUTOFF):
            mirrored = normalize(reflect(d, facing))
            waiting = push(stack, waiting, point.p, mirrored, passed, t_min, level + 1, MIRRORED, number)
    return Radiance(color, rays)


@kernel
def push(
    stack: Table, waiting: i64, o: Vec3, d: Vec3, weight: Vec3, t_min: f64, level: i64, kind: i64, parent: i64
) -> i64:
    """Put a ray on the stack; returns how many wait now."""
    top = advance(stack, waiting * RAY_WORDS)
    vec3_put(top, 0, o)
    vec3_put(top, 4, d)
    vec3_put(top, WEIGHT, weight)
    f64_put(top, T_MIN, t_min)
    i64_put(top, LEVEL, level)
    i64_put(top, KIND, kind)
    i64_put(top, PARENT, parent)
    return waiting + 1


@kernel
def illuminated(
    integrator: Table, world: Table, point: Point, start: Vec3, terms: Local, d: Vec3, t_min: f64, ray: i64,
    draws: Draws,
) -> Radiance:  # fmt: skip
    """Light that a surface sends towards the viewer by itself, from ambient light and, by rays from `start`, each light."""
    if i64_at(integrator, ILLUMINATION) == 0:
        note_term(ray, FLAT, terms.color + terms.emission)
        return Radiance(terms.color + terms.emission, 0)
    ambient = terms.ambient * vec3_at(world, WORLD_AMBIENT)
    note_term(ray, EMISSION, terms.emission)
    note_term(ray, AMBIENT, ambient)
    color = terms.emission + ambient
    rays = 0
    n = point.shading
    if i64_at(integrator, TWO_SIDED) != 0 and point.cos_view < 0.0:
        n = -n
    own = nested(draws, ray)
    dimension = 0
    for index in range(lamp_count(world)):
        light = light_at(world, index)
        received = grey(0.0)
        seen = 0.0
        count = cells(light)
        for cell in range(count):
            place = pair(own, dimension)
            dimension += 1
            sample = illuminate(light, point.p, cell, place.u, place.v)
            answer = reflected(terms, n, d, sample.direction) * sample.irradiance
            if max3(answer) > 0.0:
                visible = grey(1.0)
                if i64_at(integrator, SHADOWS) != 0:
                    rays += 1
                    way = shadow_ray(start, point.p, sample.direction, sample.distance)
                    visible = transmitted(integrator, world, way.o, way.d, t_min, way.distance)
                received += answer * visible
                seen += max3(visible)
        note_light(ray, index, seen / count, received)
        color += received
    note_term(ray, DIRECT, color - terms.emission - ambient)
    return Radiance(color, rays)


@kernel
def reflected(terms: Local, n: Vec3, d: Vec3, l: Vec3) -> Vec3:  # noqa: E741 - the textbook's letter
    """Light towards the viewer per irradiance on a surface that faces the light: diffuse and highlight."""
    n_l = dot(n, l)
    answer = terms.diffuse * max(n_l, 0.0)
    if terms.shininess >= 0.0 and max3(terms.specular) > 0.0:
        if terms.highlight == BLINN:
            cos_s = dot(n, normalize(l - d))
        else:
            cos_s = -dot(reflect(-l, n), d) if n_l > 0.0 else 0.0
        if cos_s > 0.0:
            answer += terms.specular * cos_s**terms.shininess
    return answer


@kernel
def transmitted(integrator: Table, world: Table, p: Vec3, l: Vec3, t_min: f64, distance: f64) -> Vec3:  # noqa: E741
    """Share of a light's light that arrives: 1 or 0, or what glass in between lets through if that is asked for."""
    far = distance - t_min
    if i64_at(integrator, TRANSPARENT_SHADOWS) == 0:
        return grey(0.0) if is_blocked(world, p, l, t_min, far) else grey(1.0)
    share = grey(1.0)
    t = t_min
    while max3(share) > 0.0:
        hit = find_closest(world, p, l, t, far)
        if hit.item < 0:
            break
        point = point_of(world, hit, p, l, thin_beam())
        terms = local(point.material, point.where, point.cos_view)
        share = share * terms.transmission * vexp(terms.absorption * (t_min - hit.t if t == t_min else t - hit.t))
        t = hit.t + max(t_min, 1e-12)
    return share
