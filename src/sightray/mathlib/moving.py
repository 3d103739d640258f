"""Kernels that place what moves: poses between keyframes, forwards and backwards. `mathlib.motion` writes the rows."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.motion import (
    AFTER,
    ANGLE,
    COUNT,
    FIRST,
    KEY_WORDS,
    KEYS,
    MOTION_WORDS,
    MOTIONS,
    ROTATION,
    STRETCH,
    TIME,
    TRANSLATION,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, i64_at, vec3_at
from sightray.mathlib.vec import Vec3, cross, dot


class Pose(NamedTuple):
    """An affine map by the columns of its matrix."""

    x: Vec3
    y: Vec3
    z: Vec3
    origin: Vec3


@kernel
def pose_at(placement: Table, time: f64) -> Pose:
    """``world_from_object`` at a time, seconds."""
    pose = stored(placement, FIRST)
    for k in range(i64_at(placement, MOTIONS)):
        at = MOTION_WORDS * k
        keys, count = advance(placement, i64_at(placement, at + KEYS)), i64_at(placement, at + COUNT)
        pose = after(pose, between_keys(keys, count, time))
        pose = after(pose, stored(placement, at + AFTER))
    return pose


@kernel
def stored(table: Table, at: i64) -> Pose:
    """The map whose columns stand at word `at`."""
    return Pose(vec3_at(table, at), vec3_at(table, at + 4), vec3_at(table, at + 8), vec3_at(table, at + 12))


@kernel
def after(a: Pose, b: Pose) -> Pose:
    """The map that applies b, then a."""
    return Pose(vector_by(a, b.x), vector_by(a, b.y), vector_by(a, b.z), point_by(a, b.origin))


@kernel
def between_keys(keys: Table, count: i64, time: f64) -> Pose:
    """The pose of one motion at a time."""
    # Find the last keyframe that is not later.
    low, high = 0, count
    while high - low > 1:
        middle = (low + high) // 2
        if f64_at(keys, middle * KEY_WORDS + TIME) <= time:
            low = middle
        else:
            high = middle
    k = min(low, max(count - 2, 0)) * KEY_WORDS
    n = k if count == 1 else k + KEY_WORDS
    start, span = f64_at(keys, k + TIME), f64_at(keys, n + TIME) - f64_at(keys, k + TIME)
    f = min(max((time - start) / span, 0.0), 1.0) if span > 0.0 else 0.0

    # Turn evenly from one rotation to the next; the length of the quaternion does not matter.
    a, b, angle = 1.0 - f, f, f64_at(keys, k + ANGLE)
    if angle >= 1e-9:
        a, b = math.sin((1.0 - f) * angle), math.sin(f * angle)
    q = vec3_at(keys, k + ROTATION) * a + vec3_at(keys, n + ROTATION) * b
    f0 = 1.0 - f
    s, t = k + STRETCH, n + STRETCH
    return Pose(
        turned(q, vec3_at(keys, s) * f0 + vec3_at(keys, t) * f),
        turned(q, vec3_at(keys, s + 4) * f0 + vec3_at(keys, t + 4) * f),
        turned(q, vec3_at(keys, s + 8) * f0 + vec3_at(keys, t + 8) * f),
        vec3_at(keys, k + TRANSLATION) * f0 + vec3_at(keys, n + TRANSLATION) * f,
    )


@kernel
def turned(q: Vec3, v: Vec3) -> Vec3:
    """A vector turned by a quaternion of any length: v + 2 (w n x v + n x (n x v)) / |q|²."""
    n = Vec3(q.x, q.y, q.z)
    c = cross(n, v)
    return v + (c * q.w + cross(n, c)) * (2.0 / (dot(n, n) + q.w * q.w))


@kernel
def point_by(pose: Pose, p: Vec3) -> Vec3:
    """Map a point; its 4th lane comes out as 0."""
    return vector_by(pose, p) + Vec3(pose.origin.x, pose.origin.y, pose.origin.z)


@kernel
def vector_by(pose: Pose, v: Vec3) -> Vec3:
    """Map a vector."""
    return pose.x * v.x + pose.y * v.y + pose.z * v.z


@kernel
def inverse(pose: Pose) -> Pose:
    """The inverse map, by cofactors."""
    a, b, c = cross(pose.y, pose.z), cross(pose.z, pose.x), cross(pose.x, pose.y)
    k = 1.0 / dot(pose.x, a)
    o = pose.origin
    return Pose(
        Vec3(a.x, b.x, c.x) * k, Vec3(a.y, b.y, c.y) * k, Vec3(a.z, b.z, c.z) * k,
        Vec3(-dot(a, o), -dot(b, o), -dot(c, o)) * k,
    )  # fmt: skip


@kernel
def transposed_by(pose: Pose, n: Vec3) -> Vec3:
    """Map by the transpose of the linear part: of a pose's inverse, what normals are mapped by."""
    return Vec3(dot(pose.x, n), dot(pose.y, n), dot(pose.z, n))
