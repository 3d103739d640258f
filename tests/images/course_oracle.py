"""A second, slow reader and ray tracer for course scenes: plain NumPy, brute force, nothing shared with the package."""

from __future__ import annotations

import math

import numpy as np


def rotation(axis, degrees):
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    m = np.eye(4)
    m[:3, :3] = np.eye(3) * c + s * k + (1 - c) * np.outer([x, y, z], [x, y, z])
    return m


def read(path):
    scene = {"lights": [], "objects": [], "depth": 5}
    look = {"ambient": np.full(3, 0.2), "diffuse": np.zeros(3), "specular": np.zeros(3), "emission": np.zeros(3), "s": 0.0}
    vertices, stack, attenuation = [], [np.eye(4)], (1.0, 0.0, 0.0)
    for line in path.read_text().splitlines():
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        command, *rest = line.split()
        v = np.array([float(x) for x in rest])
        if command == "size":
            scene["size"] = int(v[0]), int(v[1])
        elif command == "camera":
            scene["camera"] = v[:3], v[3:6], v[6:9], v[9]
        elif command == "maxdepth":
            scene["depth"] = int(v[0])
        elif command == "attenuation":
            attenuation = tuple(v)
        elif command in ("point", "directional"):
            scene["lights"].append((command, v[:3], v[3:], attenuation))
        elif command == "vertex":
            vertices.append(v)
        elif command in look:
            look = {**look, command: v}
        elif command == "shininess":
            look = {**look, "s": v[0]}
        elif command == "pushTransform":
            stack.append(stack[-1])
        elif command == "popTransform":
            stack.pop()
        elif command in ("translate", "scale", "rotate"):
            m = np.eye(4)
            if command == "translate":
                m[:3, 3] = v
            elif command == "scale":
                m[:3, :3] = np.diag(v)
            else:
                m = rotation(v[:3], v[3])
            stack[-1] = stack[-1] @ m
        elif command == "tri":
            corners = [(stack[-1] @ np.append(vertices[int(i)], 1))[:3] for i in v]
            scene["objects"].append(("tri", corners, look))
        elif command == "sphere":
            scene["objects"].append(("sphere", (v[:3], v[3], stack[-1]), look))
    return scene


def intersect(thing, o, d):
    kind, data, _ = thing
    if kind == "tri":
        a, b, c = data
        n = np.cross(b - a, c - a)
        n = n / np.linalg.norm(n)
        t = ((a - o) @ n) / (d @ n)
        p = o + t[:, None] * d
        inside = np.ones(len(o), bool)
        for q, r in ((a, b), (b, c), (c, a)):
            inside &= np.cross(r - q, p - q) @ n >= 0
        return np.where(inside & (t > 1e-6), t, np.inf), np.broadcast_to(n, o.shape)
    center, radius, m = data
    inverse = np.linalg.inv(m)
    oo, dd = o @ inverse[:3, :3].T + inverse[:3, 3] - center, d @ inverse[:3, :3].T
    a, b, c = (dd * dd).sum(1), 2 * (oo * dd).sum(1), (oo * oo).sum(1) - radius**2
    root = np.sqrt(np.maximum(b * b - 4 * a * c, 0))
    near, far = (-b - root) / (2 * a), (-b + root) / (2 * a)
    t = np.where(near > 1e-6, near, np.where(far > 1e-6, far, np.inf))
    t = np.where(b * b - 4 * a * c > 0, t, np.inf)
    n = (oo + np.where(np.isfinite(t), t, 0)[:, None] * dd) @ inverse[:3, :3]
    return t, n / np.linalg.norm(n, axis=1, keepdims=True)


def trace(scene, o, d, depth):
    color = np.zeros_like(o)
    best, which, normal = np.full(len(o), np.inf), np.full(len(o), -1), np.zeros_like(o)
    for index, thing in enumerate(scene["objects"]):
        t, n = intersect(thing, o, d)
        nearer = t < best
        best[nearer], which[nearer], normal[nearer] = t[nearer], index, n[nearer]
    for index, thing in enumerate(scene["objects"]):
        rays = np.flatnonzero(which == index)
        if len(rays) == 0:
            continue
        look, n, view = thing[2], normal[rays], -d[rays]
        p = o[rays] + best[rays, None] * d[rays]
        total = np.tile(look["ambient"] + look["emission"], (len(rays), 1))
        for kind, where, light, (c0, c1, c2) in scene["lights"]:
            l = where - p if kind == "point" else np.tile(where, (len(rays), 1))  # noqa: E741
            r = np.linalg.norm(l, axis=1, keepdims=True)
            l = l / r  # noqa: E741
            reach = r[:, 0] if kind == "point" else np.full(len(rays), np.inf)
            dark = np.zeros(len(rays), bool)
            for other in scene["objects"]:
                dark |= intersect(other, p, l)[0] < reach
            half = (l + view) / np.linalg.norm(l + view, axis=1, keepdims=True)
            answer = look["diffuse"] * np.maximum((n * l).sum(1), 0)[:, None]
            answer = answer + look["specular"] * np.maximum((n * half).sum(1), 0)[:, None] ** look["s"]
            fall = c0 + c1 * r + c2 * r * r if kind == "point" else 1.0
            total += np.where(dark[:, None], 0, light / fall * answer)
        if depth > 0 and look["specular"].any():
            mirrored = d[rays] - 2 * (n * d[rays]).sum(1)[:, None] * n
            total += look["specular"] * trace(scene, p, mirrored, depth - 1)
        color[rays] = total
    return color


def render(path):
    """The picture of a course scene as (height, width, 3) uint8."""
    scene = read(path)
    width, height = scene["size"]
    eye, at, up, fovy = scene["camera"]
    w = (eye - at) / np.linalg.norm(eye - at)
    u = np.cross(up, w)
    u /= np.linalg.norm(u)
    v = np.cross(w, u)
    j, i = np.meshgrid(np.arange(width), np.arange(height))
    tangent = math.tan(math.radians(fovy) / 2)
    a = tangent * (width / height) * ((j + 0.5) - width / 2) / (width / 2)
    b = tangent * (height / 2 - (i + 0.5)) / (height / 2)
    d = (a[..., None] * u + b[..., None] * v - w).reshape(-1, 3)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        color = trace(scene, np.tile(eye, (len(d), 1)), d, scene["depth"])
    return np.floor(255 * np.clip(color, 0, 1)).astype(np.uint8).reshape(height, width, 3)
