"""Scenes of few simple surfaces, as a list of pieces: what eight rays at once are met with, without a tree.

A *flat* piece is a triangle, or two of them that make up a convex quadrilateral, or a rectangle. With the corner a and two
edges, its points are a + u e_u + v e_v where u >= 0, v >= 0, and two more functions k + k_u u + k_v v, those of the other
edges, are not negative; the two of a triangle are the same. A *ball* is a sphere. Flat pieces come first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from sightray.accelerators import item as item_row
from sightray.mathlib.table import Table, aligned, link, table_at
from sightray.scene.kinds import KIND_OF, MATERIAL_OF, has_kind
from sightray.shapes.mesh import Mesh
from sightray.shapes.rectangle import Rectangle
from sightray.shapes.sphere import Sphere
from sightray.shapes.triangle import Triangle

MOST = 48  # pieces; with more, trees win

# Words of the head: how many there are, then pointers: the pieces; the first of each item's primitives, and the pieces of
# these; the pieces of lights, and the lights of pieces.
FLATS, BALLS, ROWS, FIRSTS, PIECES_OF, LIGHTS, LIGHT_OF = 0, 1, 2, 3, 4, 5, 6
REACH, CENTER = 7, 8  # largest coordinate about the centre
HEAD_WORDS = 12
# A piece, two cache lines. As floats, about the centre of all: n, -n a; U, u0 and V, v0, which give u and v of a point p as
# U p + u0, V p + v0; the functions of the other edges; slack of places.
F_NORMAL, F_U, F_V, F_THIRD, F_FOURTH, F_SIDE = 0, 4, 8, 12, 15, 18
# As doubles: unit normal n and n a, or a ball's centre and radius; then the material's row, and the number of its class (see
# `scene.kinds`).
NORMAL, OFFSET, MATERIAL, KIND = 10, 13, 14, 15
PIECE_WORDS = 16
SIDE = 384 * 2.0**-24  # slack of places on a piece, see bvh/few.py

LEFT_OUT = item_row.CUTOUT | item_row.BUMPY | item_row.ORIENTED | item_row.CLEAR | item_row.PATTERNED


class Flat(NamedTuple):
    """A flat piece in the world: corners (3 or 4, 3), and where it comes from."""

    corners: np.ndarray
    item: int
    prims: tuple[int, ...]


def pieces_of(items: Sequence[Any], flags: Sequence[int]) -> tuple[list[Flat], list[int]] | None:
    """The flat pieces and the balls (numbers of items) that a scene's items are; None if they are more than that."""
    flats: list[Flat] = []
    balls: list[int] = []
    for index, (item, flag) in enumerate(zip(items, flags, strict=True)):
        plain = item.transform.is_identity and item.placement is None and not flag & LEFT_OUT
        if not plain or not has_kind(item.material) or item.material.filled:
            return None
        shape = item.shape
        if isinstance(shape, Sphere):
            balls.append(index)
        elif isinstance(shape, Mesh) and shape.normals is None and len(shape.faces) <= 2 * MOST:
            flats += _joined(shape.vertices[shape.faces], index, joins=not item.material.glow > 0.0)
        elif isinstance(shape, Rectangle):
            q, u, v = (np.array(part) for part in (shape.corner, shape.edge_u, shape.edge_v))
            flats.append(Flat(np.stack([q, q + u, q + u + v, q + v]), index, (0,)))
        elif isinstance(shape, Triangle):
            flats.append(Flat(np.array([shape.a, shape.b, shape.c]), index, (0,)))
        else:
            return None
        if len(flats) + len(balls) > MOST:
            return None
    if not all(_has_area(flat.corners) for flat in flats):
        return None
    return (flats, balls) if flats or balls else None


def _joined(triangles: np.ndarray, item: int, joins: bool) -> Iterator[Flat]:
    """Triangles (n, corner, 3) with their neighbours in the list, if both make up a convex, flat quadrilateral."""
    k = 0
    while k < len(triangles):
        corners = _quadrilateral(*triangles[k : k + 2]) if joins and k + 1 < len(triangles) else None
        yield Flat(triangles[k], item, (k,)) if corners is None else Flat(corners, item, (k, k + 1))
        k += 1 if corners is None else 2


def _quadrilateral(one: np.ndarray, other: np.ndarray) -> np.ndarray | None:
    """Four corners around two triangles that share an edge, or None."""
    for turn in range(3):
        a, b, c = np.roll(one, -turn, axis=0)  # the shared edge is c a
        for back in range(3):
            first, second, d = np.roll(other, -back, axis=0)
            if (first == a).all() and (second == c).all():
                corners = np.stack([a, b, c, d])
                return corners if _is_flat_and_convex(corners) else None
    return None


def _has_area(corners: np.ndarray) -> bool:
    """Whether a piece is wide enough for its coordinates to be told."""
    e_u, e_v = corners[1] - corners[0], corners[-1] - corners[0]
    return bool(np.linalg.norm(np.cross(e_u, e_v)) > 1e-6 * max(e_u @ e_u, e_v @ e_v))


def _is_flat_and_convex(corners: np.ndarray) -> bool:
    edges = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(edges, np.roll(edges, -1, axis=0))
    size = np.linalg.norm(edges, axis=1).max()
    n = turns[0] / max(np.linalg.norm(turns[0]), 1e-300)
    level = np.abs((corners - corners[0]) @ n).max() <= 1e-13 * size
    return bool(level and ((turns @ n) > 1e-6 * size * size).all())


def pack_pieces(tables: Any, items: Table, things: Sequence[Any], kinds: Table, light_count: int) -> Table | None:
    """The head of a scene's pieces, or None if it is not made of such; `kinds` is the head of its materials."""
    if len(things) > MOST:
        return None
    words = items.view(np.int64).reshape(-1, item_row.ITEM_WORDS)[: len(things)]
    found = pieces_of(things, words[:, item_row.FLAGS].tolist())
    if found is None:
        return None
    flats, balls = found
    spheres = [things[index].shape for index in balls]
    boxes = [np.array(s.center) + s.radius * np.array([[-1.0] * 3, [1.0] * 3]) for s in spheres]
    points = np.concatenate([*(flat.corners for flat in flats), *boxes])
    center = 0.5 * (points.min(axis=0) + points.max(axis=0))
    rows = aligned((len(flats) + len(balls), PIECE_WORDS), np.float64)
    for row, flat in zip(rows, flats, strict=False):
        _pack_flat(row, flat.corners, center)
    for row, sphere in zip(rows[len(flats) :], spheres, strict=True):
        row[NORMAL : NORMAL + 3], row[OFFSET] = sphere.center, sphere.radius

    origins = [*((flat.item, flat.prims) for flat in flats), *((index, (0,)) for index in balls)]
    firsts = np.cumsum([0, *(len(thing.shape.faces) if isinstance(thing.shape, Mesh) else 1 for thing in things)])
    numbers, lights, light_of = np.zeros(firsts[-1], np.int64), np.full(light_count, -1), np.full(len(rows), -1)
    integers = rows.view(np.int64)
    kind_of, material_of = (table_at(kinds, word).view(np.int64) for word in (KIND_OF, MATERIAL_OF))
    for piece, (index, prims) in enumerate(origins):
        integers[piece, KIND], integers[piece, MATERIAL] = kind_of[index], material_of[index]
        light_of[piece] = words[index, item_row.LIGHT] + words[index, item_row.LIGHT_STEP] * prims[0]
        if light_of[piece] >= 0:
            lights[light_of[piece]] = piece
        numbers[[firsts[index] + prim for prim in prims]] = piece
    head = tables.space.row(HEAD_WORDS)
    counts = head.view(np.int64)
    counts[FLATS], counts[BALLS] = len(flats), len(balls)
    for word, values in ((ROWS, rows), (FIRSTS, firsts), (PIECES_OF, numbers), (LIGHTS, lights), (LIGHT_OF, light_of)):
        link(head, word, tables.space.array(np.ascontiguousarray(values)))
    head.view(np.float64)[CENTER : CENTER + 3], head.view(np.float64)[REACH] = center, np.abs(points - center).max()
    return head


def _pack_flat(row: np.ndarray, corners: np.ndarray, center: np.ndarray) -> None:
    """A flat piece's plane and coordinates, in doubles and, about `center`, in floats."""
    a, e_u, e_v = corners[0], corners[1] - corners[0], corners[-1] - corners[0]
    n = np.cross(e_u, e_v)
    n /= np.linalg.norm(n)
    across_u, across_v = np.cross(e_v, n), np.cross(n, e_u)
    first, second = across_u / (e_u @ across_u), across_v / (e_v @ across_v)
    third = fourth = np.array([1.0, -1.0, -1.0])
    if len(corners) == 4:
        c = corners[2] - a
        alpha, beta = c @ first, c @ second
        third, fourth = np.array([beta, -beta, alpha - 1.0]), np.array([alpha, beta - 1.0, -alpha])
    row[NORMAL : NORMAL + 3], row[OFFSET] = n, n @ a
    floats, a = row.view(np.float32), a - center
    for at, part in ((F_NORMAL, (*n, -n @ a)), (F_U, (*first, -first @ a)), (F_V, (*second, -second @ a)),
                     (F_THIRD, third), (F_FOURTH, fourth)):  # fmt: skip
        floats[at : at + len(part)] = part
    steepest = max(np.abs(first).sum(), np.abs(second).sum())
    floats[F_SIDE] = SIDE * steepest * max(1.0, np.abs(third).sum(), np.abs(fourth).sum())
