"""Rigid bodies: an object's mesh in its own frame, and where that stands."""

from __future__ import annotations

import weakref
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from sightray.errors import SceneError
from sightray.mathlib.transform import Transform
from sightray.scene.compile import flatten
from sightray.scene.instance import Instance
from sightray.scene.scene import Scene
from sightray.shapes.mesh import Mesh

RIGID = 1e-9  # how far axes may be from orthonormal
SWEEPS = 4  # from one end to the farthest point, for a first idea of the diameter


class Form:
    """The mesh of a body: ``vertices`` (n, 3) in metres in the body's own frame, ``faces`` (m, 3)."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray):
        self.vertices, self.faces = vertices, faces

    @cached_property
    def diameter(self) -> float:
        """Greatest distance between two vertices, metres; exact.

        With L a distance that is reached and R the radius around a centre, both ends of a longer one are farther than
        L - R from the centre: few points are, and all pairs of those are looked at.
        """
        points = np.unique(self.vertices[np.unique(self.faces)], axis=0)
        end, longest = points[0], 0.0
        for _ in range(SWEEPS):
            distance = np.linalg.norm(points - end, axis=1)
            longest, end = max(longest, float(distance.max())), points[int(distance.argmax())]
        away = np.linalg.norm(points - 0.5 * (points.min(axis=0) + points.max(axis=0)), axis=1)
        ends = points[away >= longest - away.max() - 1e-12]
        for first in range(0, len(ends), 256):
            apart = ends[first : first + 256, None] - ends[None]
            longest = max(longest, float(np.sqrt((apart**2).sum(axis=-1).max())))
        return longest

    @cached_property
    def ply(self) -> bytes:
        """A binary PLY file in millimetres, float32."""
        head = (
            "ply\nformat binary_little_endian 1.0\n"
            f"element vertex {len(self.vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
            f"element face {len(self.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
        )
        rows = np.empty(len(self.faces), np.dtype([("n", "u1"), ("corners", "<i4", 3)]))
        rows["n"], rows["corners"] = 3, self.faces
        return head.encode() + (1000 * self.vertices).astype("<f4").tobytes() + rows.tobytes()


class Body(NamedTuple):
    """A form, and the rigid ``world_from_body`` (4, 4)."""

    form: Form
    world_from_body: np.ndarray


_forms: weakref.WeakKeyDictionary[Any, Form] = weakref.WeakKeyDictionary()  # of what does not move


def body_of(thing: Any, who: str) -> Body:
    """The body of one of a scene's objects: what its outer transforms move, as far in as they are rigid.

    Raises
    ------
    SceneError
        If the object is not of meshes, or its outermost transform is not rigid.
    """
    name = f"{who}: object '{thing.name}'" if thing.name else f"{who}: a {type(thing).__name__}"
    if not is_rigid(thing.transform):
        raise SceneError(
            f"{name}: its transform is not rigid; allowed: a rotation and a translation, and Instance(of=...) of what is "
            "scaled"
        )
    pose = thing.transform.matrix
    while isinstance(thing, Instance) and is_rigid(thing.of.transform):
        thing = thing.of
        pose = pose @ thing.transform.matrix
    inner = thing.of if isinstance(thing, Instance) else thing
    if inner not in _forms:
        undo = Transform() if isinstance(thing, Instance) else Transform(thing.transform.inverse)
        _forms[inner] = _form(inner, undo, name)
    return Body(_forms[inner], pose)


def is_rigid(transform: Transform) -> bool:
    """Whether it is a rotation and a translation."""
    axes = transform.matrix[:3, :3]
    return bool(np.abs(axes.T @ axes - np.eye(3)).max() <= RIGID and np.linalg.det(axes) > 0)


def _form(thing: Any, undo: Transform, who: str) -> Form:
    """All meshes of a thing as one, after `undo`."""
    vertices, faces, n = [], [], 0
    for item in flatten(Scene(thing)):
        if not isinstance(item.shape, Mesh):
            raise SceneError(f"{who}: got a {type(item.shape).__name__}; allowed: meshes")
        vertices.append((undo @ item.transform).point(item.shape.vertices))
        faces.append(item.shape.faces + n)
        n += len(item.shape.vertices)
    return Form(np.concatenate(vertices), np.concatenate(faces))
