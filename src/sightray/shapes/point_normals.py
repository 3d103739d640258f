"""What points imply where nothing more was measured: their normals, and how far they lie apart."""

from __future__ import annotations

import heapq

import numpy as np

from sightray.bvh.neighbours import neighbours

NEIGHBOURS = 12
_ROWS = 1 << 16  # points whose neighbourhoods are in memory at a time


def estimate_normals(points: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Unit normals, (n, 3): across the plane that fits a point and its neighbours best, all on one side.

    The plane is that of the two larger principal axes (K. Pearson, 1901). Sides are made to agree along the minimum
    spanning tree of the neighbourhoods, with one less the cosine of the angle between normals as the length of an edge; the
    highest point of each connected part looks up (H. Hoppe et al., "Surface reconstruction from unorganized points",
    SIGGRAPH 1992).
    """
    normals = np.empty_like(points)
    for first in range(0, len(points), _ROWS):
        part = slice(first, first + _ROWS)
        near = np.concatenate([points[part, None], points[indices[part]]], axis=1)
        away = near - near.mean(axis=1, keepdims=True)
        normals[part] = np.linalg.eigh(np.einsum("nki,nkj->nij", away, away))[1][:, :, 0]
    return _agree(points, normals, indices)


def _agree(points: np.ndarray, normals: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Turn normals around such that neighbours look to the same side (R. Prim's tree, 1957)."""
    n, k = indices.shape
    start, end = np.repeat(np.arange(n), k), indices.ravel().astype(np.int64)
    start, end = np.concatenate([start, end]), np.concatenate([end, start])
    order = np.argsort(start, kind="stable")
    ends = end[order]
    cosines = np.einsum("ni,ni->n", normals[start[order]], normals[ends]).tolist()
    firsts, ends = np.searchsorted(start[order], np.arange(n + 1)).tolist(), ends.tolist()
    sign = [0] * n
    for seed in np.argsort(-points[:, 1], kind="stable").tolist():
        if sign[seed]:
            continue
        todo = [(0.0, seed, 1 if normals[seed, 1] >= 0 else -1)]
        while todo:
            _, i, its = heapq.heappop(todo)
            if sign[i]:
                continue
            sign[i] = its
            for e in range(firsts[i], firsts[i + 1]):
                if not sign[ends[e]]:
                    heapq.heappush(todo, (1.0 - abs(cosines[e]), ends[e], its if cosines[e] >= 0 else -its))
    return normals * np.array(sign, np.float64)[:, None]


def spacing(distances: np.ndarray) -> float:
    """How far points lie apart: the median distance to the nearest neighbour that is not at the same place."""
    apart = np.where(distances > 0, distances, np.inf).min(axis=1, initial=np.inf)
    return float(np.median(apart))


def neighbourhood(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices and distances of the nearest points of each point: as many as the plane fit takes."""
    return neighbours(points, min(NEIGHBOURS, len(points) - 1))
