"""The contract of integrators: the light that comes along one ray of sight."""

from __future__ import annotations

from typing import Any, NamedTuple

from sightray._jit import kernel, method
from sightray.cameras.base import Ray
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, advance, i64_at, i64_put, table_at, table_put, vec3_at, vec3_put
from sightray.mathlib.vec import Vec3
from sightray.registry import Member
from sightray.samplers.base import Draws

# Words of a ray in a group: the ray, the light that it is found to bring, its draws, and the brightest channel of the
# pixel so far, 0 in the beginning; two are left to the caller.
_ORIGIN, _DIRECTION, COLOR, _SAMPLER, _DRAWS, SO_FAR, MINE = 0, 4, 8, 12, 13, 18, 19
SIGHT_WORDS = 24


# Lines of a batch, in each of which there is one word for each ray and room for eight more: the ray, the light that it is
# found to bring, its draws, its moment in seconds, and lines of the caller's own.
BATCH = 128  # most rays
LINE = BATCH + 8
ORIGIN, WAY, FOUND, KEY, PIXEL, SAMPLE, TIME, MINE_TOO = (k * LINE for k in (0, 3, 6, 9, 10, 11, 12, 13))


class Batch(NamedTuple):
    """Rays that are followed together."""

    lines: Table
    size: i64  # how many
    sampler: Table
    samples: i64  # see `Draws`
    dimension: i64


class Radiance(NamedTuple):
    """What an integrator found out about a ray of sight."""

    color: Vec3
    rays: i64  # how many rays that took


class Integrator(Member, family="integrators"):
    """Base of all integrators."""

    @property
    def together(self) -> int:
        """Side of the squares of pixels whose rays are to be handed over in groups (`radiance_of_group`); 1: alone."""
        return 1

    def for_batches(self, compiled: Any) -> Integrator | None:
        """Who follows many rays at once in a scene (`radiance_of_batch`) as this one would alone; None if nobody does."""
        return None


@method(0)
def radiance(integrator: Table, world: Table, ray: Ray, draws: Draws) -> Radiance:
    """Light along a ray of sight; `draws` gives its random numbers."""
    raise NotImplementedError


@method(1)
def radiance_of_group(integrator: Table, world: Table, sights: Table, count: i64) -> i64:
    """Light along the rays of neighbouring pixels, written into the `COLOR` of each; returns the number of rays shot.

    Only integrators that say so by `together` are asked.
    """
    raise NotImplementedError


@method(2)
def radiance_of_batch(integrator: Table, world: Table, batch: Batch) -> i64:
    """Light along the rays of a batch, written into their `FOUND`; returns the number of rays shot.

    Only integrators that were named by `for_batches` are asked.
    """
    raise NotImplementedError


@kernel
def sight_of(sights: Table, k: i64) -> Table:
    """The words of ray k of a group."""
    return advance(sights, k * SIGHT_WORDS)


@kernel
def write_sight(sight: Table, ray: Ray, draws: Draws) -> None:
    """Put a ray and its draws into a group."""
    vec3_put(sight, _ORIGIN, ray.origin)
    vec3_put(sight, _DIRECTION, ray.direction)
    table_put(sight, _SAMPLER, draws.sampler)
    i64_put(sight, _DRAWS, draws.pixel)
    i64_put(sight, _DRAWS + 1, draws.key)
    i64_put(sight, _DRAWS + 2, draws.sample)
    i64_put(sight, _DRAWS + 3, draws.samples)
    i64_put(sight, _DRAWS + 4, draws.dimension)


@kernel
def ray_in(sight: Table) -> Ray:
    """The ray of a group's entry."""
    return Ray(vec3_at(sight, _ORIGIN), vec3_at(sight, _DIRECTION))


@kernel
def draws_in(sight: Table) -> Draws:
    """The draws of a group's entry."""
    return Draws(
        table_at(sight, _SAMPLER), i64_at(sight, _DRAWS), i64_at(sight, _DRAWS + 1), i64_at(sight, _DRAWS + 2),
        i64_at(sight, _DRAWS + 3), i64_at(sight, _DRAWS + 4),
    )  # fmt: skip
