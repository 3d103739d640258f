"""Examples of every shape, each with an independent definition of its surface to compare it with.

A `Piece` is a smooth function g of points that is zero on the surface and positive outside, about a distance near it,
and a margin that is positive where the piece really has points. A surface is the union of its pieces.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sightray._jit import kernel
from sightray.mathlib.scalars import f64
from sightray.shapes.box import Box
from sightray.shapes.cone import Cone
from sightray.shapes.cylinder import Cylinder
from sightray.shapes.disk import Disk
from sightray.shapes.implicit import Implicit
from sightray.shapes.mesh import Mesh
from sightray.shapes.plane import Plane
from sightray.shapes.point_cloud import PointCloud
from sightray.shapes.polygon import Polygon
from sightray.shapes.quadric import Quadric
from sightray.shapes.rectangle import Rectangle
from sightray.shapes.sphere import Sphere
from sightray.shapes.torus import Torus
from sightray.shapes.triangle import Triangle


class Piece(NamedTuple):
    g: Callable[[np.ndarray], np.ndarray]
    margin: Callable[[np.ndarray], np.ndarray] = lambda p: np.full(p.shape[:-1], np.inf)


class Example(NamedTuple):
    shape: object
    pieces: list[Piece]
    closed: bool = False
    tolerance: float = 1e-12  # of hit points, in units of the shape's size
    grazing: float = 1e-4  # sine of the angle to the surface below which a hit may be missed


def norm(p):
    return np.sqrt((np.asarray(p) ** 2).sum(axis=-1))


def facet(corner, edge_u, edge_v, triangle=False):
    """The parallelogram or triangle at a corner; g is positive on the side of edge_u x edge_v."""
    q, basis = np.asarray(corner, float), np.array([edge_u, edge_v], float)
    n = np.cross(*basis)
    n /= norm(n)
    solve = np.linalg.pinv(basis)

    def margin(p):
        s, t = np.moveaxis((p - q) @ solve, -1, 0)
        return np.minimum.reduce([s, t, 1 - s - t] if triangle else [s, t, 1 - s, 1 - t])

    return Piece(lambda p: (p - q) @ n, margin)


def box_faces(lower, upper):
    lower, upper = np.array(lower, float), np.array(upper, float)

    def face(axis, sign):
        others = [a for a in range(3) if a != axis]
        bound = upper if sign > 0 else lower
        return Piece(
            lambda p: sign * (p[..., axis] - bound[axis]),
            lambda p: np.minimum(p - lower, upper - p)[..., others].min(axis=-1),
        )

    return [face(axis, sign) for axis in range(3) for sign in (-1, 1)]


def round_body(base, top, r0, r1, capped):
    base, top = np.array(base, float), np.array(top, float)
    h = norm(top - base)
    a = (top - base) / h
    cos = h / np.hypot(h, r1 - r0)

    def height(p):
        return (p - base) @ a

    def rho(p):
        return norm(p - base - height(p)[..., None] * a)

    def off_side(p):
        return cos * (rho(p) - r0 - (r1 - r0) * height(p) / h)

    side = Piece(off_side, lambda p: np.minimum(height(p), h - height(p)))
    caps = [Piece(lambda p: -height(p), lambda p: r0 - rho(p)), Piece(lambda p: height(p) - h, lambda p: r1 - rho(p))]
    return [side, *(caps if capped else [])]


def in_box(lower, upper):
    return lambda p: np.minimum(p - np.array(lower), np.array(upper) - p).min(axis=-1)


def quadric_piece(q):
    def g(p):
        x, y, z = np.moveaxis(p, -1, 0)
        return (q.a * x * x + q.b * y * y + q.c * z * z + q.d * x * y + q.e * x * z + q.f * y * z
                + q.g * x + q.h * y + q.i * z + q.j)  # fmt: skip

    return Piece(g, in_box(q.lower, q.upper))


def winding(lines, n, u, v):
    """Margin of a flat region: signed by the sum of the angles that its border makes, sized by the distance to it."""

    def margin(p):
        total, near = 0.0, np.inf
        for line in lines:
            a, b = line[:, None], np.roll(line, -1, axis=0)[:, None]
            flat = p.reshape(-1, 3)[None]
            s = np.clip(((flat - a) * (b - a)).sum(-1) / ((b - a) ** 2).sum(-1), 0, 1)
            near = np.minimum(near, norm(flat - a - s[..., None] * (b - a)).min(axis=0))
            x, y = (a - flat) @ u + 1j * ((a - flat) @ v), (b - flat) @ u + 1j * ((b - flat) @ v)
            with np.errstate(all="ignore"):
                total = total + np.abs(np.angle(y / x).sum(axis=0)) / (2 * np.pi)
        return (np.where(np.round(total) % 2 == 1, 1, -1) * near).reshape(p.shape[:-1])

    return margin


def polygon_example():
    u, v = np.array([0.8, 0, 0.6]), np.array([0.0, 1, 0])
    n = np.cross(u, v)
    q = np.array([0.3, -0.2, 0.1])
    flat = np.array([[-1, -1], [1, -1], [1, 1], [0.2, 0.1], [-0.9, 0.8]])
    hole = np.array([[0.2, -0.7], [0.7, -0.6], [0.5, -0.2]])
    outline, inner = (q + xy @ np.array([u, v]) for xy in (flat, hole))
    piece = Piece(lambda p: (p - q) @ n, winding([outline, inner], n, u, v))
    return Example(Polygon(outline=outline, holes=[inner]), [piece])


def mesh_example(**options):
    """A ball of twenty times four triangles."""
    phi = (1 + 5**0.5) / 2
    v = np.array([(0, a, b * phi) for a in (-1, 1) for b in (-1, 1)], float)
    v = np.concatenate([v, v[:, [2, 0, 1]], v[:, [1, 2, 0]]])
    f = [(i, j, k) for i in range(12) for j in range(12) for k in range(12)
         if all(abs(norm(v[p] - v[q]) - 2) < 1e-6 for p, q in ((i, j), (j, k), (k, i)))
         and i == min(i, j, k) and np.dot(np.cross(v[j] - v[i], v[k] - v[i]), v[i]) > 0]  # fmt: skip
    normals = v / norm(v)[:, None]
    extra = {"normals": normals, "uvs": 0.5 + v @ [[0.2, 0.05], [-0.1, 0.2], [0.07, -0.1]]}
    mesh = Mesh(vertices=v, faces=f, **{name: extra[name] for name in options})
    return Example(mesh, [facet(v[i], v[j] - v[i], v[k] - v[i], triangle=True) for i, j, k in f], closed=True)


def torus_piece(c, axis, major, minor):
    a = np.array(axis, float) / norm(axis)

    def g(p):
        h = (p - c) @ a
        return np.hypot(norm(p - c - h[..., None] * a) - major, h) - minor

    return [Piece(g)]


@kernel
def wavy(x: f64, y: f64, z: f64) -> f64:
    return x * x + y * y * y * y + z * z - 0.7 + 0.1 * x * y


def wavy_expression():
    def g(p):
        x, y, z = np.moveaxis(p, -1, 0)
        return np.sin(3 * x) * np.cos(3 * y) + np.sin(3 * y) * np.cos(3 * z) + np.sin(3 * z) * np.cos(3 * x) - 0.3

    shape = Implicit(expression="sin(3*x)*cos(3*y) + sin(3*y)*cos(3*z) + sin(3*z)*cos(3*x) - 3/10")
    return Example(shape, [Piece(g, in_box((-1, -1, -1), (1, 1, 1)))])


def user_function():
    def g(p):
        x, y, z = np.moveaxis(p, -1, 0)
        return x**2 + y**4 + z**2 - 0.7 + 0.1 * x * y

    return Example(
        Implicit(function=wavy, samples=400, lower=(-2, -2, -2), upper=(2, 2, 2)), [Piece(g)], True, grazing=0.1
    )


def kinked():
    def g(p):
        x, y, z = np.moveaxis(p, -1, 0)
        return np.maximum(np.abs(x) + np.sqrt(y**2 + z**2 + 0.01), np.exp(y) - 1.5) - 0.8

    shape = Implicit(expression="max(abs(x) + sqrt(y**2 + z**2 + 0.01), exp(y) - 1.5) - 0.8")
    return Example(shape, [Piece(g, in_box((-1, -1, -1), (1, 1, 1)))])


def ball_of_points(n):
    """Points on a slightly flattened sphere, by the golden angle, with its normals."""
    height, angle = 1 - (2 * np.arange(n) + 1) / n, np.pi * (1 + 5**0.5) * np.arange(n)
    around = np.sqrt(1 - height**2)
    unit = np.stack([around * np.cos(angle), height, around * np.sin(angle)], axis=1)
    normals = unit / (1, 0.8, 1)
    return unit * (1, 0.8, 1), normals / norm(normals)[:, None]


def smooth_cloud(n=60, radius=0.65):
    points, normals = ball_of_points(n)

    def squares(p):
        return (p * p).sum(-1, keepdims=True) + (points * points).sum(-1) - 2 * p @ points.T

    def chunk(p):
        w = np.maximum(0, 1 - squares(p) / radius**2) ** 4
        with np.errstate(invalid="ignore"):
            return (w * (p @ normals.T - (points * normals).sum(-1))).sum(-1) / w.sum(-1)

    def g(p):
        parts = np.array_split(p.reshape(-1, 3), 1 + p.size // 30000)
        return np.concatenate([chunk(part) for part in parts]).reshape(p.shape[:-1])

    piece = Piece(g, lambda p: radius - np.sqrt(np.maximum(0, squares(p).min(axis=-1))))
    return Example(PointCloud(points=points, normals=normals, radius=radius), [piece], closed=True, grazing=3e-2)


def splat_cloud(n=24):
    points, normals = ball_of_points(n)
    radii = np.linspace(0.2, 0.3, n)

    def disk(p0, n0, r):
        return Piece(lambda p: (p - p0) @ n0, lambda p: r - norm(p - p0))

    cloud = PointCloud(points=points, normals=3 * normals, radius=radii, surface="splats")
    return Example(cloud, [disk(*each) for each in zip(points, normals, radii, strict=True)])


C, N = np.array([0.4, -0.3, 0.2]), np.array([0.3, 0.8, -0.5])
N1 = N / norm(N)
LOWER, UPPER = (-0.5, -1, 0.2), (0.7, 0.6, 1)
P, Q = (0.2, -0.4, 0.1), (0.9, 1.1, -0.7)
QUADRICS = (Quadric.ellipsoid((1, 0.6, 1.3)), Quadric.paraboloid((0.8, 1), 1.5), Quadric.elliptic_cone((1, 0.7), 1.2),
            Quadric.elliptic_cone(double=True), Quadric.hyperboloid((0.5, 0.7, 0.6)),
            Quadric.hyperboloid_of_two_sheets((0.5, 0.4, 0.6), 3),
            Quadric(a=1, d=0.7, e=-0.4, f=0.3, g=0.2, h=-0.5, i=1, j=-0.1, lower=(-1, -2, -1), upper=(2, 1, 1.5)),
            Quadric(g=1, h=2, i=-1, j=0.1), Quadric(a=1, h=-1))  # fmt: skip

EXAMPLES: dict[str, list[Example]] = {
    "Sphere": [Example(Sphere(center=C, radius=0.7), [Piece(lambda p: norm(p - C) - 0.7)], closed=True)],
    "Plane": [Example(Plane(point=C, normal=N), [Piece(lambda p: (p - C) @ N1)]),
              Example(Plane(), [Piece(lambda p: p[..., 1])])],
    "Disk": [Example(Disk(center=C, normal=N, radius=1.2, inner_radius=0.4),
                     [Piece(lambda p: (p - C) @ N1, lambda p: np.minimum(1.2 - norm(p - C), norm(p - C) - 0.4))]),
             Example(Disk(), [Piece(lambda p: p[..., 1], lambda p: 1 - norm(p))])],
    "Rectangle": [Example(Rectangle(corner=C, edge_u=Q, edge_v=(-0.5, 0.9, 0.4)), [facet(C, Q, (-0.5, 0.9, 0.4))]),
                  Example(Rectangle(), [facet((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))])],
    "Triangle": [Example(Triangle(a=C, b=C + Q, c=C - N), [facet(C, Q, -N, triangle=True)])],
    "Box": [Example(Box(lower=LOWER, upper=UPPER), box_faces(LOWER, UPPER), True)],
    "Polygon": [polygon_example()],
    "Mesh": [mesh_example(), mesh_example(normals=1, uvs=1)],
    "Cylinder": [Example(Cylinder(base=P, top=Q, radius=0.6), round_body(P, Q, 0.6, 0.6, True), True),
                 Example(Cylinder(capped=False, radius=0.5), round_body((0, 0, 0), (0, 1, 0), 0.5, 0.5, False))],
    "Cone": [Example(Cone(base=P, top=Q, base_radius=0.9), round_body(P, Q, 0.9, 0, True), True),
             Example(Cone(base_radius=0.3, top_radius=0.8), round_body((0, 0, 0), (0, 1, 0), 0.3, 0.8, True), True),
             Example(Cone(base=P, top=Q, base_radius=0.9, top_radius=0.2, capped=False),
                     round_body(P, Q, 0.9, 0.2, False))],
    "Quadric": [Example(q.replace(transform=None), [quadric_piece(q)]) for q in QUADRICS],
    "Torus": [Example(Torus(center=C, axis=N, major_radius=1, minor_radius=0.3), torus_piece(C, N, 1, 0.3), True),
              Example(Torus(minor_radius=0.02), torus_piece(0 * C, (0, 1, 0), 1, 0.02), True),
              Example(Torus(minor_radius=0.95), torus_piece(0 * C, (0, 1, 0), 1, 0.95), True)],
    "Implicit": [wavy_expression(), kinked(), user_function()],
    "PointCloud": [smooth_cloud(), splat_cloud()],
}  # fmt: skip
