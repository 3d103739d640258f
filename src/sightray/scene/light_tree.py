"""A tree over lights: clusters of which is known where their light comes from, where it goes, and what they cannot reach.

Grown from the top down. Of several cuts along each axis, the one with the least cost is taken: the sum over both sides
of intensity times surface area of the box times a measure of the cone (section 4.4 of A. Conty Estevez, C. Kulla,
"Importance sampling of many lights with adaptive tree splitting", PACMCGIT 1(2), 2018). While cuts are compared, the
opening of a cone is estimated from the mean m of its directions, by cos = 2 |m| - 1, which holds for even caps.

Of each cluster the finished tree knows bounds, namely a ball around it and a cone around all normals, and moments,
weighted by intensity: mean and variance of the places, mean of the normals. Bounds say what cannot be lit; moments say
how much light there is to expect. A choice by moments is far less noisy than one by bounds alone (Y. Tokuyoshi, S.
Ikeda, P. Kulkarni, T. Harada, "Hierarchical light sampling with accurate spherical Gaussian lighting", SIGGRAPH Asia
2024, do the same with spherical Gaussians).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sightray.accelerators.grow import Level, Tree, grow_tree
from sightray.lights.base import LightBounds
from sightray.mathlib.table import Space, Table, aligned, link

# The chooser's row. LEAF_OF: for each light, eight times the node that it is in, plus the lane.
NODES, LEAF_OF, APART, APART_COUNT, CHOOSER_WORDS = 0, 1, 2, 3, 4
# A node is 88 words. First the place of what its numbers are measured from, and the inverse of their unit, metres; then
# where its parent stands as LEAF_OF says it, or -1.
WIDTH = 8
ORIGIN, PARENT = 0, 4
# Then floats of its up to eight children, each kind eight times: centres, variances and mean normals along x, y and z;
# axes of the cones of normals; radii of the balls; weights; SCATTER, the variance of normals along any axis; cosines and
# sines of the cones; EDGE, the cosine beyond which there is no light; SIZE, numbers of lights, 0 where there is no child.
CENTER, VARIANCE, MEAN, AXIS = 16, 40, 64, 88
RADIUS, WEIGHT, SCATTER, COS_NORMALS, SIN_NORMALS, EDGE, SIZE = 112, 120, 128, 136, 144, 152, 160
CHILDREN, NODE_WORDS = 168, 88  # eight integers: number of a node, or -1 minus that of a light
# How much wider than they are bounds are taken, for single precision: of radii, in parts and in units, and of cosines.
WIDER, AROUND, EDGEWISE = 1e-5, 1e-6, 2e-3
BINS = 12
FEW = 8  # lights, up to which a cluster is halved without further thought
MEDIAN_FROM = 24  # levels; from here on clusters are halved, so that no input makes a deep tree


class Cones(NamedTuple):
    """Directions into which n clusters shine, at most."""

    axis: np.ndarray  # (n, 3) unit
    normals: np.ndarray  # (n,) half-angles of the normals, radians, up to pi
    spread: np.ndarray  # (n,) how far from the normals light goes, radians
    intensity: np.ndarray  # (n,) along the normals, W/sr


class Moments(NamedTuple):
    """Where the light of n clusters comes from, on average."""

    weight: np.ndarray  # (n,)
    center: np.ndarray  # (n, 3)
    variance: np.ndarray  # (n, 3) along x, y and z
    normal: np.ndarray  # (n, 3) mean, up to 1 long


def pack_chooser(space: Space, bounds: Sequence[tuple[int, LightBounds]], count: int) -> Table:
    """The row that `choose_light` reads, for `count` lights: first number and bounds of those that stand somewhere."""
    row = space.row(CHOOSER_WORDS)
    leaf_of = np.full(max(1, count), -1, np.int64)
    if bounds:
        numbers = np.concatenate([first + np.arange(np.size(b.intensity)) for first, b in bounds])
        nodes = build_nodes(*gathered([b for _, b in bounds]), numbers)
        children = nodes.view(np.int32)[:, CHILDREN : CHILDREN + WIDTH]
        node, lane = np.nonzero((children < 0) & (nodes.view(np.float32)[:, SIZE : SIZE + WIDTH] > 0))
        leaf_of[-1 - children[node, lane]] = WIDTH * node + lane
        link(row, NODES, space.array(nodes))
    apart = np.flatnonzero(leaf_of[:count] < 0)
    link(row, LEAF_OF, space.array(leaf_of))
    link(row, APART, space.array(apart) if len(apart) else None)
    row.view(np.int64)[APART_COUNT] = len(apart)
    return row


def gathered(bounds: Sequence[LightBounds]) -> tuple[np.ndarray, np.ndarray, Cones]:
    """Boxes, each (n, 3), and cones of all lights."""
    lower, upper, axis = (
        np.concatenate([np.reshape(getattr(b, name), (-1, 3)) for b in bounds]).astype(np.float64)
        for name in ("lower", "upper", "axis")
    )
    normals, spread, intensity = (
        np.concatenate([np.broadcast_to(getattr(b, name), np.shape(b.intensity)).reshape(-1) for b in bounds])
        for name in ("normals", "spread", "intensity")
    )
    return lower, upper, Cones(axis, normals, spread, intensity)


def build_nodes(lower: np.ndarray, upper: np.ndarray, cones: Cones, numbers: np.ndarray) -> np.ndarray:
    """The nodes' rows, (m, NODE_WORDS) float64, for lights with these boxes, cones and numbers."""
    tree = grow_tree(lower, upper, _Cut(cones))
    bound, mean = merge_up(tree, cones, moments_of(lower, upper, cones))
    roots, children = widened(tree)
    nodes = aligned((len(roots), NODE_WORDS), np.float64)
    single, whole = nodes.view(np.float32), nodes.view(np.int64)

    # Measure from the middle of each node, in units of its size.
    low, high = tree.lower[roots], tree.upper[roots]
    unit = np.maximum((high - low).max(axis=1), 1e-9 * np.abs(high + low).max(axis=1) + 1e-30)
    nodes[:, ORIGIN : ORIGIN + 3], nodes[:, ORIGIN + 3] = 0.5 * (low + high), 1.0 / unit

    there = children >= 0
    of = np.where(there, children, 0)
    middle = (mean.center[of] - nodes[:, None, ORIGIN : ORIGIN + 3]) / unit[:, None, None]
    farthest = np.maximum(tree.upper[of] - mean.center[of], mean.center[of] - tree.lower[of])
    radius = np.linalg.norm(farthest, axis=-1) / unit[:, None]
    weight = np.where(there, mean.weight[of], 0.0)
    weight = weight / np.maximum(weight.max(axis=1, keepdims=True), 1e-300)
    for first, values in ((CENTER, middle), (VARIANCE, mean.variance[of] / unit[:, None, None] ** 2),
                          (MEAN, mean.normal[of]), (AXIS, bound.axis[of])):  # fmt: skip
        single[:, first : first + 3 * WIDTH] = values.transpose(0, 2, 1).reshape(len(roots), -1)
    for first, value in (
        (RADIUS, radius * (1.0 + WIDER) + AROUND), (WEIGHT, weight),
        (SCATTER, np.maximum(1.0 - (mean.normal[of] ** 2).sum(axis=-1), 0.0) / 3.0),
        (COS_NORMALS, np.cos(bound.normals[of])), (SIN_NORMALS, np.sin(bound.normals[of])),
        (EDGE, np.cos(bound.spread[of]) - EDGEWISE), (SIZE, np.where(there, tree.size[of], 0)),
    ):  # fmt: skip
        single[:, first : first + WIDTH] = value

    # Say who the children are, and to them who their parent is.
    number = np.full(len(tree.child), -1)
    number[roots] = np.arange(len(roots))
    light = numbers[tree.order[tree.first[of]]]
    nodes.view(np.int32)[:, CHILDREN : CHILDREN + WIDTH] = np.where(tree.leaf[of], -1 - light, number[of])
    whole[:, PARENT] = -1
    node, lane = np.nonzero(there & ~tree.leaf[of])
    whole[number[of[node, lane]], PARENT] = WIDTH * node + lane
    return nodes


def widened(tree: Tree) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of a binary tree that stay when three levels become one: their numbers, (m,), and children, (m, 8), or -1.

    The root comes first. A tree of one leaf has a node with one child.
    """
    roots, children, level = [], [], np.zeros(1, np.int64)
    while len(level):
        below = level[:, None]
        for _ in range(3):
            opened = (below >= 0) & ~tree.leaf[below]
            first = np.where(opened, tree.child[below], below)
            below = np.stack([first, np.where(opened, first + 1, -1)], axis=-1).reshape(len(level), -1)
        roots.append(level)
        children.append(below)
        level = below[(below >= 0) & ~tree.leaf[below]]
    return np.concatenate(roots), np.concatenate(children)


def soft_positive(x: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """About the mean of what is positive of a number that has mean x and a variance; see `light_choice.soft`."""
    return 0.5 * (x + np.sqrt(x * x + 2.0 / np.pi * variance))


def moments_of(lower: np.ndarray, upper: np.ndarray, cones: Cones) -> Moments:
    """The moments of single lights: each fills its box, and its cone of normals is an even cap."""
    size = 0.5 * (1.0 + np.cos(cones.normals))  # of the mean of an even cap
    along = soft_positive(size, (1.0 - size**2) / 3.0)  # what is expected of it along its axis
    center, variance = 0.5 * (lower + upper), (upper - lower) ** 2 / 12.0
    return Moments(cones.intensity / along, center, variance, cones.axis * size[:, None])


class _Cut:
    """Where to cut the clusters of a level, as `grow_tree` asks."""

    def __init__(self, cones: Cones):
        self.moment = np.column_stack([cones.intensity, cones.intensity[:, None] * cones.axis])
        # The mean direction of an even cap is (1 + cos)/2 long.
        self.moment[:, 1:] *= 0.5 * (1.0 + np.cos(cones.normals))[:, None]

    def __call__(self, level: Level, depth: int) -> tuple[np.ndarray, np.ndarray]:
        center = level.centers()
        low = np.minimum.reduceat(center, level.start)
        extent = np.maximum.reduceat(center, level.start) - low
        left = level.size // 2  # halves, where no better cut is to be had
        key = center[np.arange(len(center)), extent.argmax(axis=1)[level.node]]
        large = np.flatnonzero(level.size > FEW)
        if depth >= MEDIAN_FROM or not len(large):
            return key, left

        # Compare cuts of the larger clusters, numbered anew.
        number = np.full(len(level.size), -1)
        number[large] = np.arange(len(large))
        of = np.flatnonzero(number[level.node] >= 0)
        node = number[level.node[of]]
        best = np.full(len(large), np.inf)
        for axis in range(3):
            wide = np.where(extent[large, axis] > 0.0, extent[large, axis], 1.0)
            place = (center[of, axis] - low[large, axis][node]) / wide[node]
            bins = np.minimum(BINS - 1, (place * BINS).astype(np.int64))
            cost, count = self.costs(level, of, node, bins)
            # Thin clusters are cut across their length.
            cost *= np.where(extent[large, axis] > 0.0, extent[large].max(axis=1) / wide, np.inf)[:, None]
            cut = cost.argmin(axis=1)
            rows = np.arange(len(large))
            better = cost[rows, cut] < best
            best[better] = cost[rows, cut][better]
            left[large[better]] = count[rows, cut][better]
            key[of[better[node]]] = bins[better[node]]
        return key, left

    def costs(self, level: Level, of: np.ndarray, node: np.ndarray, bins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cost of the cuts between bins, infinite where a side is empty, and lights before them: (k, BINS - 1) each.

        Light number of[i] of the level is in bin bins[i] of cluster node[i] of k.
        """
        k = int(node[-1]) + 1
        slot = node * BINS + bins
        count = np.bincount(slot, minlength=k * BINS).reshape(k, BINS)
        sums = np.stack([np.bincount(slot, m, minlength=k * BINS) for m in self.moment[level.which[of]].T], axis=1)
        lower, upper = np.full((k * BINS, 3), np.inf), np.full((k * BINS, 3), -np.inf)
        np.minimum.at(lower, slot, level.lower[of])
        np.maximum.at(upper, slot, level.upper[of])
        moment, low, high = sums.reshape(k, BINS, 4), lower.reshape(k, BINS, 3), upper.reshape(k, BINS, 3)
        before = side_cost(moment, low, high)[:, :-1]
        behind = side_cost(moment[:, ::-1], low[:, ::-1], high[:, ::-1])[:, -2::-1]
        first = count.cumsum(axis=1)[:, :-1]
        empty = (first == 0) | (first == count.sum(axis=1)[:, None])
        return np.where(empty, np.inf, before + behind), first


def side_cost(moment: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Intensity times area times cone of the first bin, of the first two, and so on: (k, BINS)."""
    total = moment.cumsum(axis=1)
    size = np.maximum(np.maximum.accumulate(upper, axis=1) - np.minimum.accumulate(lower, axis=1), 0.0)
    area = size[..., 0] * size[..., 1] + size[..., 1] * size[..., 2] + size[..., 2] * size[..., 0]
    area += 1e-3 * (size**2).sum(axis=-1)  # so that lights on a line or point are told apart as well
    intensity = total[..., 0]
    mean = np.linalg.norm(total[..., 1:], axis=-1) / np.where(intensity > 0.0, intensity, 1.0)
    return intensity * area * cone_measure(np.clip(2.0 * mean - 1.0, -1.0, 1.0))


def cone_measure(cosine: np.ndarray) -> np.ndarray:
    """How far lights shine whose normals fill a cone: the solid angle of all directions, each by its cosine beyond it.

    For spreads of a right angle the integral is 2 pi (1 - cos) + pi/2 (2 w sin - cos(angle - 2 w) - 2 angle sin + cos)
    with w the smaller of angle + pi/2 and pi.
    """
    angle = np.arccos(cosine)
    end = np.minimum(angle + 0.5 * np.pi, np.pi)
    sine = np.sin(angle)
    beyond = 2.0 * end * sine - np.cos(angle - 2.0 * end) - 2.0 * angle * sine + cosine
    return 2.0 * np.pi * (1.0 - cosine) + 0.5 * np.pi * beyond


def merge_up(tree: Tree, cones: Cones, moments: Moments) -> tuple[Cones, Moments]:
    """Cones and moments of all nodes, from those of the lights, by ever larger clusters."""
    light = tree.order[tree.first]
    bound, mean = Cones(*(part[light] for part in cones)), Moments(*(part[light] for part in moments))
    depth = np.zeros(len(tree.child), np.int64)
    inner = np.flatnonzero(~tree.leaf)
    for node in inner:  # children stand behind their parents
        depth[tree.child[node]] = depth[tree.child[node] + 1] = depth[node] + 1
    for level in range(int(depth.max()) - 1, -1, -1):
        nodes = inner[depth[inner] == level]
        first, second = tree.child[nodes], tree.child[nodes] + 1
        whole = union(Cones(*(part[first] for part in bound)), Cones(*(part[second] for part in bound)))
        for part, value in zip(bound, whole, strict=True):
            part[nodes] = value
        both = mixture(Moments(*(part[first] for part in mean)), Moments(*(part[second] for part in mean)))
        for part, value in zip(mean, both, strict=True):
            part[nodes] = value
    return bound, mean


def mixture(a: Moments, b: Moments) -> Moments:
    """The moments of pairs of clusters together; dark ones count alike."""
    weight = a.weight + b.weight
    share = np.divide(b.weight, weight, where=weight > 0.0, out=np.full(len(weight), 0.5))[:, None]  # of b
    apart = b.center - a.center
    variance = a.variance + (b.variance - a.variance) * share + apart**2 * share * (1.0 - share)
    normal = a.normal + (b.normal - a.normal) * share
    return Moments(weight, a.center + apart * share, variance, normal)


def union(a: Cones, b: Cones) -> Cones:
    """The smallest cones around pairs of cones; those of dark clusters do not count."""
    between = np.arccos(np.clip((a.axis * b.axis).sum(axis=1), -1.0, 1.0))
    half = 0.5 * (a.normals + b.normals + between)
    turn = half - a.normals  # from the axis of a towards that of b

    # Turn the axis of a by Rodrigues' formula about what is perpendicular to both.
    across = np.cross(a.axis, b.axis)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    across = across / np.where(size > 0.0, size, 1.0)
    axis = a.axis * np.cos(turn)[:, None] + np.cross(across, a.axis) * np.sin(turn)[:, None]
    whole = (half >= np.pi) | ((size[:, 0] == 0.0) & (between > 1.0))
    only_a = (np.minimum(between + b.normals, np.pi) <= a.normals) | (b.intensity <= 0.0)
    only_b = ~only_a & ((np.minimum(between + a.normals, np.pi) <= b.normals) | (a.intensity <= 0.0))
    normals = np.select([only_a, only_b, whole], [a.normals, b.normals, np.pi], np.minimum(half + 1e-7, np.pi))
    keep_a, keep_b = (only_a | (whole & ~only_b))[:, None], only_b[:, None]
    axis = np.where(keep_a, a.axis, np.where(keep_b, b.axis, axis))
    spread = np.where(
        b.intensity <= 0.0, a.spread, np.where(a.intensity <= 0.0, b.spread, np.maximum(a.spread, b.spread))
    )
    return Cones(axis, normals, spread, a.intensity + b.intensity)
