"""Which light to look at next: one of all, with a known probability.

A path tracer looks at one light at each point. `choose_light` says at which, and `light_probability` with which
probability it would have said so, which is what multiple importance sampling asks when a ray meets a light by chance.

The lights that stand somewhere are the leaves of a tree of clusters (`scene.light_tree`). From the root down, one of
up to eight children is chosen in proportion to how much light each is expected to bring: eight estimates take no longer
than one, and ten thousand lights cost five decisions. Lights without a place, such as skies and suns, stand apart: each
has the same chance, and so has the tree.

References: A. Conty Estevez, C. Kulla, "Importance sampling of many lights with adaptive tree splitting", PACMCGIT
1(2), 2018; Y. Tokuyoshi et al., "Hierarchical light sampling with accurate spherical Gaussian lighting", SIGGRAPH Asia
2024.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.bvh.bvh8 import int_at
from sightray.mathlib.lanes import F32x8, load8, select8, splat8, sqrt8, store8, vmax8, vmin8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f32_at, i64_at, is_null, scratch, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, max3, vabs
from sightray.scene.light_tree import (
    APART,
    APART_COUNT,
    AXIS,
    CENTER,
    CHILDREN,
    COS_NORMALS,
    EDGE,
    LEAF_OF,
    MEAN,
    NODE_WORDS,
    NODES,
    ORIGIN,
    PARENT,
    RADIUS,
    SCATTER,
    SIN_NORMALS,
    SIZE,
    VARIANCE,
    WEIGHT,
    WIDTH,
)
from sightray.scene.world import CHOOSER, light_count

BELOW_ONE = 1.0 - 2.0**-53
PARTS_WORDS = WIDTH // 2  # eight floats
NEARNESS = 0.5  # of the variance of places, that is added to the squared distance
LEAST = 1e-10  # variance of a cosine, so that rounding never makes light that arrives impossible
FAR = 1e15  # coordinate, in units of the cluster, beyond which all lights are as far away


class Choice(NamedTuple):
    """A light, and how likely it was to be chosen."""

    light: i64  # its number; -1 where there is no light at all
    probability: f64


@kernel
def choose_light(world: Table, p: Vec3, n: Vec3, u: f64) -> Choice:
    """One of the lights, for a surface at p that is lit from the side of its unit normal n, by a number u in [0, 1).

    Where light from all sides counts, as at points of media, n is the zero vector.
    """
    if light_count(world) < 2:
        return Choice(light_count(world) - 1, 1.0 * light_count(world))
    chooser = table_at(world, CHOOSER)
    nodes = table_at(chooser, NODES)

    # Choose one of the lights that stand apart, or the tree.
    apart = i64_at(chooser, APART_COUNT)
    total = apart if is_null(nodes) else apart + 1
    which = min(total - 1, int(u * total))
    probability = 1.0 / total
    if which < apart:
        return Choice(i64_at(table_at(chooser, APART), which), probability)
    u = min(u * total - which, BELOW_ONE)

    # Go down the tree.
    child = 0
    while child >= 0:
        node = advance(nodes, child * NODE_WORDS)
        parts = scratch(PARTS_WORDS)
        all_parts = weigh(node, p, n, parts)
        goal, below, lane, part, before = u * all_parts, 0.0, -1, 0.0, 0.0
        for k in range(WIDTH):  # the last child that begins before the goal, of those with a part
            size = float(f32_at(parts, k))
            if size > 0.0 and (lane < 0 or before <= goal):
                lane, part, below = k, size, before
            before += size
        u = min(max((goal - below) / part, 0.0), BELOW_ONE)
        probability *= part / all_parts
        child = int_at(node, CHILDREN + lane)
    return Choice(-1 - child, probability)


@kernel
def light_probability(world: Table, p: Vec3, n: Vec3, light: i64) -> f64:
    """Probability with which `choose_light`, for the same p and n, chooses a light."""
    if light_count(world) < 2:
        return 1.0
    chooser = table_at(world, CHOOSER)
    nodes = table_at(chooser, NODES)
    probability = 1.0 / (i64_at(chooser, APART_COUNT) + (0 if is_null(nodes) else 1))
    at = i64_at(table_at(chooser, LEAF_OF), light)  # eight times the node, plus the lane

    # Go up the tree.
    while at >= 0:
        node, parts = advance(nodes, (at >> 3) * NODE_WORDS), scratch(PARTS_WORDS)
        all_parts = weigh(node, p, n, parts)
        probability *= float(f32_at(parts, at & 7)) / all_parts
        at = i64_at(node, PARENT)
    return probability


@kernel
def weigh(node: Table, p: Vec3, n: Vec3, parts: Table) -> f64:
    """What the children of a node weigh, and its sum: by their light, or, if none of it can arrive, by their lights."""
    store8(parts, 0, importance(node, p, n))
    total = total_of(parts)
    if total > 0.0:
        return total
    store8(parts, 0, load8(node, SIZE))
    return total_of(parts)


@kernel
def total_of(parts: Table) -> f64:
    """Sum of eight numbers, in their order."""
    total = 0.0
    for k in range(WIDTH):
        total += float(f32_at(parts, k))
    return total


@kernel
def importance(node: Table, p: Vec3, n: Vec3) -> F32x8:
    """About how much irradiance each child of a node sends to a surface: intensity cos cos / distance², expected.

    0 only where none of its light can arrive: within the ball around it, nothing is before the surface, or nothing is
    on the side to which the cone of normals shines. Bounds are a little wider than they are (see `light_tree`), for
    what rounding to single precision does.
    """
    origin = vec3_at(node, ORIGIN)
    place = (p - origin) * origin.w
    far = max3(vabs(place))
    if far > FAR:
        place = place * (FAR / far)
    zero, one = splat8(0.0), splat8(1.0)
    nx, ny, nz = splat8(n.x), splat8(n.y), splat8(n.z)
    x, y, z = (
        load8(node, CENTER) - splat8(place.x),
        load8(node, CENTER + 8) - splat8(place.y),
        load8(node, CENTER + 16) - splat8(place.z),
    )
    d2 = x * x + y * y + z * z
    along_normal = nx * x + ny * y + nz * z

    # Seen from outside of its ball, a cluster may be out of sight.
    radius = load8(node, RADIUS)
    distance = sqrt8(d2)
    ratio = vmin8(radius / vmax8(distance, splat8(1e-30)), one)
    behind = zero - along_normal > radius + distance * splat8(1e-6)
    axis_x, axis_y, axis_z = load8(node, AXIS), load8(node, AXIS + 8), load8(node, AXIS + 16)
    cosine = (zero - (axis_x * x + axis_y * y + axis_z * z)) / vmax8(distance, splat8(1e-30))
    cosine = cosine_less(cosine, load8(node, COS_NORMALS), load8(node, SIN_NORMALS))
    cosine = cosine_less(cosine, sqrt8(one - ratio * ratio), ratio)
    averted = cosine <= load8(node, EDGE)

    # Expect of each factor its mean over the cluster.
    vx, vy, vz = load8(node, VARIANCE), load8(node, VARIANCE + 8), load8(node, VARIANCE + 16)
    d2 = d2 + splat8(NEARNESS) * (vx + vy + vz) + splat8(1e-30)
    shorter = one / sqrt8(d2)
    inverse = shorter * shorter
    within = vmax8(zero, one - (x * x + y * y + z * z) * inverse) / splat8(3.0)
    mean_x, mean_y, mean_z = load8(node, MEAN), load8(node, MEAN + 8), load8(node, MEAN + 16)
    facing = (zero - (mean_x * x + mean_y * y + mean_z * z)) * shorter
    expected = load8(node, WEIGHT) * inverse * soft(facing, load8(node, SCATTER) + within)
    if dot(n, n) > 0.0:
        spread = (vx * nx * nx + vy * ny * ny + vz * nz * nz) * inverse
        expected = expected * soft(along_normal * shorter, spread)
    return select8((distance > radius) & (behind | averted), zero, expected)


@kernel
def soft(x: F32x8, variance: F32x8) -> F32x8:
    """About the mean of what is positive of a number that has mean x and a variance; never 0.

    Right for large means, and for normally distributed numbers of mean 0.
    """
    zero = splat8(0.0)
    variance = variance + splat8(LEAST)
    size = vmax8(x, zero - x)
    sum_of_both = sqrt8(x * x + splat8(2.0 / math.pi) * variance) + size
    return select8(x >= zero, splat8(0.5) * sum_of_both, variance / (splat8(math.pi) * sum_of_both))


@kernel
def cosine_less(cosine: F32x8, cos_less: F32x8, sin_less: F32x8) -> F32x8:
    """Cosine of an angle from which another one, given by cosine and sine, is taken away; 1 if nothing is left."""
    one = splat8(1.0)
    sine = sqrt8(vmax8(splat8(0.0), one - cosine * cosine))
    return select8(cosine >= cos_less, one, cosine * cos_less + sine * sin_less)
