"""Which light to look at next: one of all, with a known probability.

A path tracer looks at one light at each point. `choose_light` says at which, and `light_probability` with which
probability it would have said so, which is what multiple importance sampling asks when a ray meets a light by chance.

The lights that stand somewhere are the leaves of a tree of clusters (`scene.light_tree`). From the root down, one of
two children is chosen in proportion to how much light each is expected to bring, so ten thousand lights cost fourteen
decisions. Lights without a place, such as skies and suns, stand apart: each has the same chance, and so has the tree.

References: A. Conty Estevez, C. Kulla, "Importance sampling of many lights with adaptive tree splitting", PACMCGIT
1(2), 2018; Y. Tokuyoshi et al., "Hierarchical light sampling with accurate spherical Gaussian lighting", SIGGRAPH Asia
2024.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, i64_at, is_null, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot
from sightray.scene.light_tree import (
    APART,
    APART_COUNT,
    AXIS,
    CENTER,
    CHILD,
    COS_NORMALS,
    LEAF_OF,
    LIGHT_OF,
    MEAN,
    NODE_WORDS,
    NODES,
    PARENT,
    SIN_NORMALS,
    SIZE,
    VARIANCE,
)
from sightray.scene.world import CHOOSER, light_count

BELOW_ONE = 1.0 - 2.0**-53
NEARNESS = 0.5  # of the variance of places, that is added to the squared distance


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
    node = advance(nodes, 0)
    while i64_at(node, CHILD) >= 0:
        left = advance(nodes, i64_at(node, CHILD) * NODE_WORDS)
        right = advance(left, NODE_WORDS)
        share = share_of_first(left, right, p, n)
        if u < share:
            node, u = left, min(u / share, BELOW_ONE)
            probability *= share
        else:
            node, u = right, min((u - share) / (1.0 - share), BELOW_ONE)
            probability *= 1.0 - share
    return Choice(i64_at(node, LIGHT_OF), probability)


@kernel
def light_probability(world: Table, p: Vec3, n: Vec3, light: i64) -> f64:
    """Probability with which `choose_light`, for the same p and n, chooses a light."""
    if light_count(world) < 2:
        return 1.0
    chooser = table_at(world, CHOOSER)
    nodes = table_at(chooser, NODES)
    probability = 1.0 / (i64_at(chooser, APART_COUNT) + (0 if is_null(nodes) else 1))
    at = i64_at(table_at(chooser, LEAF_OF), light)
    if at < 0:
        return probability

    # Go up the tree.
    while at > 0:
        parent = i64_at(nodes, at * NODE_WORDS + PARENT)
        first = i64_at(nodes, parent * NODE_WORDS + CHILD)
        left = advance(nodes, first * NODE_WORDS)
        share = share_of_first(left, advance(left, NODE_WORDS), p, n)
        probability *= share if at == first else 1.0 - share
        at = parent
    return probability


@kernel
def share_of_first(left: Table, right: Table, p: Vec3, n: Vec3) -> f64:
    """Probability of the first of two nodes: by their light, or, if none of it can arrive, by their lights."""
    a, b = importance(left, p, n), importance(right, p, n)
    if not a + b > 0.0:
        a, b = float(i64_at(left, SIZE)), float(i64_at(right, SIZE))
    return a / (a + b)


@kernel
def importance(node: Table, p: Vec3, n: Vec3) -> f64:
    """About how much irradiance a cluster of lights sends to a surface: intensity cos cos / distance², expected.

    0 only where none of its light can arrive: within the ball around it, nothing is before the surface, or nothing is
    on the side to which the cone of normals shines.
    """
    center, variance = vec3_at(node, CENTER), vec3_at(node, VARIANCE)
    to_light = center - p
    d2 = dot(to_light, to_light)
    radius2 = variance.w
    if d2 > radius2:
        axis = vec3_at(node, AXIS)
        distance = math.sqrt(d2)
        if -dot(n, to_light) > math.sqrt(radius2):
            return 0.0
        cosine = cosine_less(-dot(axis, to_light) / distance, f64_at(node, COS_NORMALS), f64_at(node, SIN_NORMALS))
        if cosine_less(cosine, math.sqrt(1.0 - radius2 / d2), math.sqrt(radius2 / d2)) <= axis.w:
            return 0.0

    # Expect of each factor its mean over the cluster.
    d2 += NEARNESS * (variance.x + variance.y + variance.z) + 1e-30
    to_light = to_light / math.sqrt(d2)  # shorter than 1 where the cluster is around
    normal = vec3_at(node, MEAN)
    within = max(0.0, 1.0 - dot(to_light, to_light)) / 3.0
    expected = center.w / d2 * soft(-dot(normal, to_light), normal.w + within)
    if dot(n, n) > 0.0:
        expected *= soft(dot(n, to_light), dot(variance, n * n) / d2)
    return expected


@kernel
def soft(x: f64, variance: f64) -> f64:
    """About the mean of what is positive of a number that has mean x and a variance; never 0 if the variance is not.

    Right for large means, and for normally distributed numbers of mean 0.
    """
    root = math.sqrt(x * x + 2.0 / math.pi * variance)
    return 0.5 * (x + root) if x >= 0.0 else variance / (math.pi * (root - x))


@kernel
def cosine_less(cosine: f64, cos_less: f64, sin_less: f64) -> f64:
    """Cosine of an angle from which another one, given by cosine and sine, is taken away; 1 if nothing is left."""
    if cosine >= cos_less:
        return 1.0
    return cosine * cos_less + math.sqrt(max(0.0, 1.0 - cosine * cosine)) * sin_less
