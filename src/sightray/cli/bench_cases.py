"""What ``sightray bench rays`` traces: scenes and rays, made by the same numbers every time.

| case | |
|---|---|
| balls | 40 bumpy balls over a floor, 527,362 triangles: the case of the first table of docs/performance.md |
| thin | 50,000 triangles, each a thousand times as long as it is wide, in all directions: their boxes are mostly empty |
| million | a hilly torus of 1,000,000 triangles |
| instances | one bumpy ball of 1280 triangles, in 10,000 places |
| spheres | 100,000 spheres |
| stadium | a fine teapot in a huge stadium of few triangles |
| adversarial | the balls, met by rays with zeros in their direction, from surfaces, and from a million metres away |

Any other name is that of a file with meshes, or of a built-in scene, whose meshes are taken.

**Coherent** rays are those of a camera of 1024 x 1024 pixels (thin: 512 x 512), in tiles of 8 x 8; **diffuse** rays leave
the points that these hit, in directions spread by the cosine. All are single precision, because that is what other ray
tracers take, and rows of three, because that is how arrays (n, 3) lie as a rule.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

Rays = tuple[np.ndarray, np.ndarray]  # origins and directions, (n, 3) float32
PIXELS = 1024


class Case(NamedTuple):
    """Something to trace, and with what. Of the last three, other ray tracers are given what is not None."""

    name: str
    scene: Any
    rays: dict[str, Rays]
    mesh: tuple[np.ndarray, np.ndarray] | None = None  # vertices (n, 3) and faces (m, 3)
    places: np.ndarray | None = None  # (k, 4, 4) transforms of that mesh; None if it is shown once, where it stands
    spheres: np.ndarray | None = None  # (n, 4) centres and radii


def case_named(name: str) -> Case:
    """The case of that name, or of the meshes of that file or built-in scene."""
    make = CASES.get(name)
    return mesh_case(Path(name).name, *meshes_of(name)) if make is None else make()


# -------------------------------------------------------------------------------------------------------------- meshes


def icosphere(levels: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices on the unit sphere, and faces: an icosahedron whose triangles were cut into four, `levels` times."""
    g = (1 + 5**0.5) / 2
    vertices = np.array(
        [[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g],
         [0, -1, -g], [0, 1, -g], [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]]
    )  # fmt: skip
    faces = np.array(
        [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
         [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7],
         [9, 8, 1]]
    )  # fmt: skip
    for _ in range(levels):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, which = np.unique(edges, axis=0, return_inverse=True)
        a, b, c = faces.T
        ab, bc, ca = which.reshape(-1, 3).T + len(vertices)
        vertices = np.concatenate([vertices, vertices[unique].mean(axis=1)])
        faces = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def bumpy_ball(levels: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A ball with bumps of two sizes; a seed for each."""
    n, faces = icosphere(levels)
    r = 1 + 0.15 * np.sin(7 * n[:, 0] + seed) * np.cos(5 * n[:, 1])
    r += 0.05 * np.sin(31 * n[:, 2] + seed) * np.sin(29 * n[:, 0])
    return n * r[:, None], faces


def joined(parts: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Several meshes as one: vertices float32, as all ray tracers are given them, and faces int32."""
    first = np.cumsum([0] + [len(vertices) for vertices, _ in parts])
    vertices = np.concatenate([v for v, _ in parts]).astype(np.float32)
    return vertices, np.concatenate([f + k for (_, f), k in zip(parts, first, strict=False)]).astype(np.int32)


def balls_mesh() -> tuple[np.ndarray, np.ndarray]:
    """40 balls and a floor."""
    rng = np.random.default_rng(1)
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    for seed in range(40):
        center, size = np.zeros(3), 2.0
        if seed:
            center, size = rng.uniform(-6, 6, 3) * [1, 1, 0.3], rng.uniform(0.3, 0.9)
        ball, faces = bumpy_ball(4 if seed else 7, seed)
        parts.append((ball * size + center, faces))
    floor = np.array([[-10, -10, -3], [10, -10, -3], [10, 10, -3], [-10, 10, -3.0]])
    return joined([*parts, (floor, np.array([[0, 1, 2], [0, 2, 3]]))])


def torus_mesh(triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """A torus with hills, of about so many triangles, four times as many around as across."""
    across = max(3, round((triangles / 8) ** 0.5))
    around = max(3, round(triangles / (2 * across)))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))
    a, b = 2 * np.pi * i / around, 2 * np.pi * j / across
    r = 1 + 0.1 * np.sin(9 * a) * np.cos(4 * b) + 0.03 * np.sin(37 * a + 1) * np.sin(11 * b)
    out = 3 + r * np.cos(b)
    vertices = np.stack([out * np.cos(a), out * np.sin(a), r * np.sin(b)], axis=1).astype(np.float32)
    right, up = (i + 1) % around * across, (j + 1) % across
    corner = [i * across + j, right + j, right + up, i * across + up]
    faces = np.concatenate([np.stack([corner[k] for k in t], axis=1) for t in ((0, 1, 2), (0, 2, 3))])
    return vertices, faces.astype(np.int32)


def thin_mesh(triangles: int = 50_000) -> tuple[np.ndarray, np.ndarray]:
    """Slivers in a box, about one long and a thousandth wide, in all directions."""
    rng = np.random.default_rng(3)
    start, along, aside = rng.uniform(-3, 3, (triangles, 3)), *rng.normal(size=(2, triangles, 3))
    along *= rng.uniform(0.5, 1.5, (triangles, 1)) / np.linalg.norm(along, axis=1, keepdims=True)
    aside = np.cross(along, aside)
    aside *= 1e-3 / np.linalg.norm(aside, axis=1, keepdims=True)
    vertices = np.stack([start, start + along, start + aside], axis=1).reshape(-1, 3)
    return vertices.astype(np.float32), np.arange(3 * triangles, dtype=np.int32).reshape(-1, 3)


def meshes_of(name: str) -> tuple[np.ndarray, np.ndarray]:
    """All meshes of a file or built-in scene, as one, in the world."""
    import sightray as sr
    from sightray import scenes
    from sightray.errors import SceneError, unknown
    from sightray.scene.compile import flatten

    if not Path(name).suffix and name not in scenes.names():
        told = unknown("case", name, [*CASES, *scenes.names()])
        raise SceneError(f"--case: {told}; or a file's name with its suffix")
    scene = sr.load(name)
    parts = [
        (item.transform.point(item.shape.vertices), item.shape.faces)
        for item in flatten(scene)
        if isinstance(item.shape, sr.Mesh)
    ]
    if not parts:
        raise SceneError(f"--case: {name}: no meshes in it; allowed: a file or scene with some, {', '.join(CASES)}")
    return joined(parts)


# ---------------------------------------------------------------------------------------------------------------- rays


def camera_rays(eye: Any, target: Any, half: float, pixels: int = PIXELS) -> Rays:
    """Rays through the pixels of a square picture, in tiles of 8 x 8; `half` is the tangent of half its angle."""
    tile, inside = np.divmod(np.arange(pixels**2), 64)
    rows, columns = np.divmod(tile, pixels // 8)
    y, x = rows * 8 + inside // 8, columns * 8 + inside % 8
    forward = np.asarray(target, float) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    u, v = ((x + 0.5) / pixels * 2 - 1) * half, (1 - (y + 0.5) / pixels * 2) * half
    d = forward + u[:, None] * right + v[:, None] * np.cross(right, forward)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return np.full(d.shape, eye, np.float32), d.astype(np.float32)


def rays_around(lower: np.ndarray, upper: np.ndarray, pixels: int = PIXELS) -> Rays:
    """Rays of a camera that sees all of a box."""
    center, radius = (lower + upper) / 2, float(np.linalg.norm(upper - lower)) / 2
    eye = center + 2.5 * radius * np.array([0.4, -0.8, 0.45]) / np.linalg.norm([0.4, -0.8, 0.45])
    return camera_rays(eye, center, 0.4, pixels)


def bounce_rays(scene: Any, o: np.ndarray, d: np.ndarray, lift: float = 1e-4) -> Rays:
    """Rays that leave `lift` above where others hit, with directions spread by the cosine around the normal."""
    hits = scene.intersect(o, d)
    hit = hits.hit
    n = hits.normal[hit] * -np.sign(np.sum(hits.normal[hit] * d[hit], axis=1, keepdims=True))
    w = np.random.default_rng(2).normal(size=n.shape)
    w = w / np.linalg.norm(w, axis=1, keepdims=True) + n
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    return (hits.position[hit] + lift * n).astype(np.float32), w.astype(np.float32)


def both(scene: Any, o: np.ndarray, d: np.ndarray, lift: float = 1e-4) -> dict[str, Rays]:
    """Rays of a camera, and those that leave from what it sees."""
    return {"coherent": (o, d), "diffuse": bounce_rays(scene, o, d, lift)}


# --------------------------------------------------------------------------------------------------------------- cases


def mesh_case(name: str, vertices: np.ndarray, faces: np.ndarray, pixels: int = PIXELS) -> Case:
    """A mesh, seen from aside."""
    import sightray as sr

    scene = sr.Scene(sr.Mesh(vertices=vertices, faces=faces))
    lower, upper = vertices.min(axis=0).astype(float), vertices.max(axis=0).astype(float)
    lift = 1e-5 * float(np.linalg.norm(upper - lower))
    return Case(name, scene, both(scene, *rays_around(lower, upper, pixels), lift), (vertices, faces))


def balls() -> Case:
    import sightray as sr

    mesh = balls_mesh()
    scene = sr.Scene(sr.Mesh(vertices=mesh[0], faces=mesh[1]))
    return Case("balls", scene, both(scene, *camera_rays((0, -14, 4.0), (0, 0, 0), 0.5)), mesh)


def adversarial() -> Case:
    rng = np.random.default_rng(4)
    case = balls()
    vertices, faces = case.mesh or balls_mesh()
    n = 1 << 18
    corner = vertices[rng.integers(0, len(vertices), n)].astype(float)

    # Through vertices along an axis, or with one zero.
    d = rng.normal(size=(n, 3))
    d[np.arange(n), rng.integers(0, 3, n)] = 0.0
    d[: n // 2] = np.eye(3)[rng.integers(0, 3, n // 2)] * rng.choice([-1.0, 1.0], (n // 2, 1))
    zeros = (corner - 8 * d).astype(np.float32), d.astype(np.float32)

    # From the middle of triangles, rounded to single precision, which may be either side of them.
    middle = vertices[faces[rng.integers(0, len(faces), n)]].mean(axis=1)
    surface = middle.astype(np.float32), rng.normal(size=(n, 3)).astype(np.float32)

    # From a million metres away to vertices: origins are rounded by some centimetres, the rays as they are are exact.
    away = rng.normal(size=(n, 3))
    eye = (corner + 1e6 * away / np.linalg.norm(away, axis=1, keepdims=True)).astype(np.float32)
    far = eye, (corner - eye).astype(np.float32)
    return case._replace(name="adversarial", rays={"zeros": zeros, "from surface": surface, "from 1e6": far})


def instances(count: int = 10_000) -> Case:
    import sightray as sr

    rng = np.random.default_rng(5)
    vertices, faces = joined([bumpy_ball(3, 1)])
    ball = sr.Mesh(vertices=vertices, faces=faces)
    axes, at, size = rng.normal(size=(count, 3)), rng.uniform(-10, 10, (count, 3)), rng.uniform(0.1, 0.3, count)
    turns = [sr.Transform.rotate(axis, 360 * rng.random()) for axis in axes]
    sizes = [sr.Transform.scale(s) for s in size]
    places = [sr.Transform.translate(*p) @ turn @ size for p, turn, size in zip(at, turns, sizes, strict=True)]
    scene = sr.Scene(*[sr.Instance(of=ball, transform=place) for place in places])
    rays = both(scene, *rays_around(np.full(3, -10.0), np.full(3, 10.0)))
    return Case("instances", scene, rays, (vertices, faces), np.array([place.matrix for place in places]))


def spheres(count: int = 100_000) -> Case:
    import sightray as sr

    rng = np.random.default_rng(6)
    table = np.concatenate([rng.uniform(-10, 10, (count, 3)), rng.uniform(0.03, 0.12, (count, 1))], axis=1)
    scene = sr.Scene(*[sr.Sphere(center=row[:3], radius=row[3]) for row in table])
    rays = both(scene, *rays_around(np.full(3, -10.0), np.full(3, 10.0)))
    return Case("spheres", scene, rays, spheres=table)


def stadium() -> Case:
    import sightray as sr

    vertices, faces = meshes_of("teapot-in-stadium")
    camera = sr.load("teapot-in-stadium").camera
    upright = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], np.float32)  # y up to z up
    mesh = vertices @ upright.T, faces
    scene = sr.Scene(sr.Mesh(vertices=mesh[0], faces=faces))
    o, d = camera_rays(upright @ camera.eye, upright @ camera.target, np.tan(np.radians(camera.vfov / 2)))
    return Case("stadium", scene, both(scene, o, d), mesh)


CASES: dict[str, Callable[[], Case]] = {
    "balls": balls, "thin": lambda: mesh_case("thin", *thin_mesh(), pixels=512),
    "million": lambda: mesh_case("million", *torus_mesh(1_000_000)), "instances": instances, "spheres": spheres,
    "stadium": stadium, "adversarial": adversarial,
}  # fmt: skip
