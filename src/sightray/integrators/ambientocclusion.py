"""How open surfaces are: cracks and corners are dark, whatever the light."""

from __future__ import annotations

import math

from sightray._jit import implements
from sightray.cameras.base import Ray
from sightray.fields import flag
from sightray.fields import number as real
from sightray.integrators.base import Integrator, Radiance, radiance
from sightray.integrators.shading import first_step, frame_of, on_true_side, out_of
from sightray.integrators.solid import closest_solid, solid_between
from sightray.mathlib.table import Table, f64_at, i64_at, no_table
from sightray.mathlib.vec import grey
from sightray.mathlib.warp import power_cosine
from sightray.samplers.base import Draws, pair
from sightray.scene.world import on_seen_side, point_of, sight_beam


class AmbientOcclusion(Integrator):
    """The share of the hemisphere over a surface from which nothing is near: 1 in the open, 0 in a closed box.

    A = integral of V(wi) cos wi / pi over the hemisphere, V = 1 where a ray of length `distance` meets nothing; without
    `cosine`, the integral of V(wi) / (2 pi). It is the light of an even sky of radiance 1 on a white surface, without
    what surfaces send one another (S. Zhukov, A. Iones, G. Kronin, "An ambient light illumination model", EGWR 1998).
    Rays of sight that meet nothing are white. Materials, lights and media do not matter.
    """

    distance: float | None = real(
        "how far surfaces cast their shade; None for any distance", default=None, above=0, unit="m", optional=True
    )
    cosine: bool = flag("directions count by their cosine, as light does", default=True)


DISTANCE, COSINE = AmbientOcclusion.offsets()
WAY = 0  # dimension of the draws


@implements(radiance, AmbientOcclusion)
def ambient_occlusion_radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    d = ray.direction
    hit = closest_solid(world, ray.origin, d, 0.0, math.inf)
    if hit.item < 0:
        return Radiance(grey(1.0), 1)
    point = on_seen_side(point_of(world, hit, ray.origin, d, sight_beam(world, draws, no_table())), d)

    # Choose a direction on the side that is seen, and look whether it is open.
    way = pair(draws, WAY)
    over = power_cosine(1.0 * i64_at(integrator, COSINE), way.u, way.v)
    if point.cos_view < 0.0:
        over = -over
    out = on_true_side(point, d, out_of(frame_of(point), over), False)
    reach = f64_at(integrator, DISTANCE)
    t_max = reach if reach == reach else math.inf
    shaded = solid_between(world, point.p, out, first_step(math.nan, point.p, hit.t), t_max)
    return Radiance(grey(0.0 if shaded else 1.0), 2)
