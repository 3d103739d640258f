"""Exact light from polygons: Lambert's formula instead of samples."""

from __future__ import annotations

import math

from sightray._jit import implements, kernel
from sightray.cameras.base import Ray
from sightray.fields import flag, integer
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.shading import first_step
from sightray.integrators.solid import closest_solid, solid_between
from sightray.integrators.terminator import lifted, shadow_ray
from sightray.lights.base import LightPolygon, cells, illuminate, polygon
from sightray.materials.base import emitted, local
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, i64_at, no_table
from sightray.mathlib.vec import Vec3, cross, dot, grey, length, max3
from sightray.samplers.base import Draws, nested, pair
from sightray.scene.world import background, light_at, light_count, on_seen_side, point_of, sight_beam


class AnalyticDirect(Integrator):
    """Diffuse reflection of the direct light of polygons, without a sample and so without noise.

    A polygon of radiance L brings a point with normal n, if nothing stands between, the irradiance ::

        E = L/2 sum over its edges of theta_i (n . gamma_i)

    with theta_i the angle under which edge i is seen from the point, and gamma_i the unit normal of the plane through
    the edge and the point (J. H. Lambert, Photometria, 1760; J. Arvo, "Applications of irradiance tensors to the
    simulation of non-Lambertian phenomena", SIGGRAPH 1995). What is below the horizon of n is cut off first. Exact for
    `RectangleLight`, and for rectangles, triangles and meshes that glow evenly; lights without extent are exact anyway,
    and of others one point in each of their cells stands for them.

    Obstacles do not shade, unless `shadows` is set: then the exact light is multiplied by the share of light that gets
    through, which is estimated (E. Heitz, S. Hill, M. McGuire, "Combining analytic direct illumination and stochastic
    shadows", I3D 2018). That leaves noise in half-shadows only, and a small bias there, which falls with `shadow_rays`.

    Surfaces answer as `materials.base.local` says: with `diffuse` times E. There are no highlights, no mirrors, no
    ambient light, nothing of a background or a glowing hull around the point, and media do not matter.
    """

    shadows: bool = flag("whether obstacles shade", default=False)
    shadow_rays: int = integer("rays to each polygon, if there are shadows; at least one for each of its cells",
                               default=16, at_least=1, at_most=1 << 16)  # fmt: skip


SHADOWS, SHADOW_RAYS = AnalyticDirect.offsets()


@implements(radiance, AnalyticDirect)
def analytic_direct_radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    d = ray.direction
    hit = closest_solid(world, ray.origin, d, 0.0, math.inf)
    if hit.item < 0:
        return Radiance(background(world, d), 1)
    point = on_seen_side(point_of(world, hit, ray.origin, d, sight_beam(world, draws, no_table())), d)
    n = point.shading if point.cos_view >= 0.0 else -point.shading
    t_min = first_step(math.nan, point.p, hit.t)
    start, arrived = lifted(world, hit, point), grey(0.0)
    rays = 1
    for index in range(light_count(world)):
        if index == point.light:
            continue  # a flat light is at its own horizon
        found = from_light(integrator, world, light_at(world, index), point.p, start, n, t_min, nested(draws, index))
        arrived += found.color
        rays += found.rays
    diffuse = local(point.material, point.where, point.cos_view).diffuse
    return Radiance(emitted(point.material, point.where, point.cos_view) + diffuse * arrived, rays)


@kernel
def from_light(
    integrator: Table, world: Table, light: Table, p: Vec3, start: Vec3, n: Vec3, t_min: f64, own: Draws
) -> Radiance:
    """Irradiance of one light at p, and how many rays that took."""
    shape, shadows = polygon(light, p), i64_at(integrator, SHADOWS) != 0
    exact = shape.radiance * per_radiance(shape, p, n) if shape.corners > 0 else grey(0.0)
    if shape.corners > 0 and (not shadows or max3(exact) <= 0.0):
        return Radiance(exact, 0)

    # Sample the light: all of it, and what comes through.
    parts = cells(light)
    count = parts * (max(1, i64_at(integrator, SHADOW_RAYS) // parts) if shape.corners > 0 else 1)
    whole, left = grey(0.0), grey(0.0)
    rays = 0
    for k in range(count):
        place = pair(own, k)
        sample = illuminate(light, p, k % parts, place.u, place.v)
        term = sample.irradiance * (max(0.0, dot(n, sample.direction)) * parts / count)
        if max3(term) > 0.0:
            whole += term
            rays += 1 if shadows else 0
            ray = shadow_ray(start, p, sample.direction, sample.distance)
            if not shadows or not solid_between(world, ray.o, ray.d, t_min, ray.distance - t_min):
                left += term
    if shape.corners == 0:
        return Radiance(left, rays)
    return Radiance(exact * (max3(left) / max3(whole)) if max3(whole) > 0.0 else left, rays)


@kernel
def per_radiance(shape: LightPolygon, p: Vec3, n: Vec3) -> f64:
    """Irradiance that a polygon of radiance 1 brings to p, whose unit normal is n: what is above the horizon counts."""
    total = 0.0
    rising, setting = grey(0.0), grey(0.0)  # where the outline crosses the horizon
    a = corner_of(shape, shape.corners - 1) - p
    height_a = dot(a, n)
    for k in range(shape.corners):
        b = corner_of(shape, k) - p
        height_b = dot(b, n)
        start, end = a, b
        if height_a < 0.0 <= height_b:
            start = a + (b - a) * (height_a / (height_a - height_b))
            rising = start
        elif height_b < 0.0 <= height_a:
            end = a + (b - a) * (height_a / (height_a - height_b))
            setting = end
        if height_a >= 0.0 or height_b >= 0.0:
            total += edge(start, end, n)
        a, height_a = b, height_b
    return 0.5 * abs(total + edge(setting, rising, n))


@kernel
def corner_of(shape: LightPolygon, k: i64) -> Vec3:
    """Corner number k, in order around the polygon."""
    if k == 0:
        return shape.a
    if k == 1:
        return shape.a + shape.u
    return shape.a + shape.u + shape.v if k == 2 and shape.corners == 4 else shape.a + shape.v


@kernel
def edge(a: Vec3, b: Vec3, n: Vec3) -> f64:
    """theta n . gamma of the edge from a to b; 0 for one that is seen end on."""
    across = cross(a, b)
    size = length(across)
    if not size > 0.0:
        return 0.0
    return math.atan2(size, dot(a, b)) * dot(n, across) / size
