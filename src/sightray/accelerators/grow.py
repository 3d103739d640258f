"""Growing binary trees over objects, level by level, with NumPy: what `Bounds` and `Bvh2` share.

A node is a range of a permutation of the primitives. All nodes of a level are divided at once, so that the work is a few
array operations for each level, and there are about as many levels as the number of primitives has bits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

MEDIAN_FROM = 32  # levels; from here on ranges are halved, so that no input makes a tree deeper than a stack
MAX_DEPTH = MEDIAN_FROM + 32


class Level(NamedTuple):
    """The nodes of a level that may be divided, and the primitives in them."""

    node: np.ndarray  # (m,) which node each primitive is in: 0, 0, 1, 1, 1, 2 ...
    start: np.ndarray  # (k,) where the node's primitives begin in these arrays
    size: np.ndarray  # (k,) how many they are
    lower: np.ndarray  # (m, 3) boxes of the primitives
    upper: np.ndarray
    box_lower: np.ndarray  # (k, 3) boxes of the nodes
    box_upper: np.ndarray
    which: np.ndarray  # (m,) numbers of the primitives

    def centers(self) -> np.ndarray:
        """Twice the centres of the primitives."""
        return self.lower + self.upper


class Tree(NamedTuple):
    """A binary tree in breadth-first order: m nodes over n primitives."""

    lower: np.ndarray  # (m, 3) float64
    upper: np.ndarray
    first: np.ndarray  # (m,) int64: all primitives below a node are a range of `order`
    size: np.ndarray  # (m,)
    child: np.ndarray  # (m,) the first of two children, which stand side by side; -1 for a leaf
    order: np.ndarray  # (n,) a permutation

    @property
    def leaf(self) -> np.ndarray:
        """Which nodes are leaves."""
        return self.child < 0


# Given a level and its depth: for each primitive a key to sort its node by, and for each node how many of the
# lowest keys go to the first child; 0 to make it a leaf.
Divide = Callable[[Level, int], tuple[np.ndarray, np.ndarray]]


def grow_tree(lower: np.ndarray, upper: np.ndarray, divide: Divide) -> Tree:
    """Grow a tree over boxes, each (n, 3) float64, n > 0."""
    order = np.arange(len(lower))
    first, count = np.array([0]), np.array([len(order)])
    levels: list[tuple[np.ndarray, ...]] = []
    nodes = 0
    while len(first):
        # Gather the primitives of all nodes of this level, node by node.
        start = np.cumsum(count) - count
        node = np.repeat(np.arange(len(first)), count)
        where = np.arange(count.sum()) - start[node] + first[node]
        low, high = lower[order[where]], upper[order[where]]
        boxes = np.minimum.reduceat(low, start), np.maximum.reduceat(high, start)
        level = Level(node, start, count, low, high, *boxes, order[where])

        # Divide them: the range of a node is sorted, and cut in two.
        key, left = divide(level, len(levels))
        order[where] = order[where][np.lexsort((key, node))]
        inner = left > 0
        nodes += len(first)
        child = np.full(len(first), -1)
        child[inner] = nodes + 2 * np.arange(inner.sum())
        levels.append((level.box_lower, level.box_upper, first, count, child))
        f, n, k = first[inner], count[inner], left[inner]
        first, count = np.stack([f, f + k], axis=1).ravel(), np.stack([k, n - k], axis=1).ravel()
    box_lower, box_upper, first, size, child = (np.concatenate(parts) for parts in zip(*levels, strict=True))
    return Tree(box_lower, box_upper, first, size, child, order)


def halve(level: Level, leaf_size: int) -> tuple[np.ndarray, np.ndarray]:
    """Cut at the median of the centres along the axis on which they spread most."""
    center = level.centers()
    spread = np.maximum.reduceat(center, level.start) - np.minimum.reduceat(center, level.start)
    axis = spread.argmax(axis=1)[level.node]
    return center[np.arange(len(center)), axis], np.where(level.size > leaf_size, level.size // 2, 0)
