"""``sightray bench rays``: rays each second against other ray tracers, on the same mesh, rays and cores, in one run.

The mesh is 40 bumpy balls over a floor, 527,362 triangles. **Coherent** rays are those of a camera of 1024 x 1024 pixels,
in tiles of 8 x 8; **diffuse** rays leave the points that these hit, in directions spread by the cosine. All take NumPy
arrays of single precision and give back NumPy arrays: t and triangle for the nearest hit, a truth value for any. Peers take
part in turns (A B A B), and medians are compared.
"""

from __future__ import annotations

import json as json_module
import os
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

QUESTIONS = ("coherent closest", "diffuse closest", "coherent any", "diffuse any")
ROUNDS = 7

Cast = Callable[[np.ndarray, np.ndarray], Any]


class Tracer(NamedTuple):
    """One way to trace: two functions of origins and directions, (n, 3) float32."""

    name: str
    closest: Cast
    any: Cast


# ------------------------------------------------------------------------------------------------------- mesh and rays


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


def make_mesh() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) float32 and faces (m, 3) int32 of the balls and the floor."""
    rng = np.random.default_rng(1)
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    for seed in range(40):
        n, faces = icosphere(4 if seed else 7)
        center, size = np.zeros(3), 2.0
        if seed:
            center, size = rng.uniform(-6, 6, 3) * [1, 1, 0.3], rng.uniform(0.3, 0.9)
        r = 1 + 0.15 * np.sin(7 * n[:, 0] + seed) * np.cos(5 * n[:, 1])
        r += 0.05 * np.sin(31 * n[:, 2] + seed) * np.sin(29 * n[:, 0])
        parts.append((n * r[:, None] * size + center, faces))
    floor = np.array([[-10, -10, -3], [10, -10, -3], [10, 10, -3], [-10, 10, -3.0]])
    parts.append((floor, np.array([[0, 1, 2], [0, 2, 3]])))
    first = np.cumsum([0] + [len(vertices) for vertices, _ in parts])
    vertices = np.concatenate([v for v, _ in parts]).astype(np.float32)
    return vertices, np.concatenate([f + k for (_, f), k in zip(parts, first, strict=False)]).astype(np.int32)


def camera_rays(pixels: int = 1024) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions, (pixels^2, 3) float32, in tiles of 8 x 8."""
    tile, inside = np.divmod(np.arange(pixels**2), 64)
    rows, columns = np.divmod(tile, pixels // 8)
    y, x = rows * 8 + inside // 8, columns * 8 + inside % 8
    eye = np.array([0, -14, 4.0])
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    u, v = ((x + 0.5) / pixels * 2 - 1) * 0.5, (1 - (y + 0.5) / pixels * 2) * 0.5
    d = forward + u[:, None] * right + v[:, None] * np.cross(right, forward)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    return np.broadcast_to(eye, d.shape).astype(np.float32), d.astype(np.float32)


def bounce_rays(scene: Any, o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays that leave where others hit, with directions spread by the cosine around the normal."""
    hits = scene.intersect(o, d)
    hit = hits.hit
    n = hits.normal[hit] * -np.sign(np.sum(hits.normal[hit] * d[hit], axis=1, keepdims=True))
    w = np.random.default_rng(2).normal(size=n.shape)
    w = w / np.linalg.norm(w, axis=1, keepdims=True) + n
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    return (hits.position[hit] + 1e-4 * n).astype(np.float32), w.astype(np.float32)


# ------------------------------------------------------------------------------------------------------------- tracers


def sightray_tracer(scene: Any, threads: int) -> Tracer:
    """This library, through the calls that everybody makes."""

    def closest(o: np.ndarray, d: np.ndarray) -> Any:
        hits = scene.intersect(o, d, threads=threads)
        return hits.t, hits.primitive

    return Tracer("sightray", closest, lambda o, d: scene.occluded(o, d, threads=threads))


def open3d_tracer(vertices: np.ndarray, faces: np.ndarray, threads: int) -> Tracer:
    """Open3D's RaycastingScene: Embree 4, many rays at a time."""
    import open3d as o3d

    tensor = o3d.core.Tensor
    scene = o3d.t.geometry.RaycastingScene(nthreads=threads)
    scene.add_triangles(tensor(vertices), tensor(faces.astype(np.uint32)))

    def closest(o: np.ndarray, d: np.ndarray) -> Any:
        answer = scene.cast_rays(tensor(np.concatenate([o, d], axis=1)), nthreads=threads)
        return answer["t_hit"].numpy(), answer["primitive_ids"].numpy()

    def occluded(o: np.ndarray, d: np.ndarray) -> Any:
        return scene.test_occlusions(tensor(np.concatenate([o, d], axis=1)), nthreads=threads).numpy()

    return Tracer(f"Open3D {o3d.__version__}", closest, occluded)


def mitsuba_tracer(vertices: np.ndarray, faces: np.ndarray, threads: int) -> Tracer:
    """Mitsuba 3, llvm: Embree with packets of sixteen."""
    import drjit
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    drjit.set_thread_count(threads)
    mesh = mi.Mesh("mesh", len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"], parameters["faces"] = vertices.ravel(), faces.astype(np.uint32).ravel()
    parameters.update()
    scene = mi.load_dict({"type": "scene", "mesh": mesh})

    def rays(o: np.ndarray, d: np.ndarray) -> Any:
        return mi.Ray3f(mi.Point3f(np.ascontiguousarray(o.T)), mi.Vector3f(np.ascontiguousarray(d.T)))

    def closest(o: np.ndarray, d: np.ndarray) -> Any:
        found = scene.ray_intersect_preliminary(rays(o, d), coherent=False)
        drjit.eval(found)
        return found.t.numpy(), found.prim_index.numpy()

    return Tracer(f"Mitsuba {mi.__version__}", closest, lambda o, d: scene.ray_test(rays(o, d), coherent=False).numpy())


def embreex_tracer(vertices: np.ndarray, faces: np.ndarray, threads: int) -> Tracer:
    """embreex: Embree 4, one ray at a time on one thread."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, vertices, faces)

    def closest(o: np.ndarray, d: np.ndarray) -> Any:
        answer = scene.run(o, d, output=1)
        return answer["tfar"], answer["primID"]

    return Tracer("embreex, 1 thread", closest, lambda o, d: scene.run(o, d, query="OCCLUDED"))


def trimesh_tracer(vertices: np.ndarray, faces: np.ndarray, threads: int) -> Tracer:
    """trimesh, with embreex if that is there."""
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    return Tracer(f"trimesh {trimesh.__version__}", mesh.ray.intersects_first, mesh.ray.intersects_any)


PEERS = {
    "Open3D": open3d_tracer, "Mitsuba": mitsuba_tracer, "embreex": embreex_tracer, "trimesh": trimesh_tracer,
}  # fmt: skip


# ----------------------------------------------------------------------------------------------------------- measuring


class Result(NamedTuple):
    """What a tracer can do, in millions of rays each second, in the order of `QUESTIONS`; or why it is absent."""

    name: str
    rates: tuple[float, ...]
    absent: str = ""


def seconds(call: Cast, o: np.ndarray, d: np.ndarray) -> float:
    """How long one call takes."""
    start = time.perf_counter()
    call(o, d)
    return time.perf_counter() - start


def measure(peers: bool, threads: int, rounds: int = ROUNDS) -> tuple[list[Result], dict[str, Any]]:
    """The rates of all tracers, ours first; and facts about the mesh and the machine."""
    import sightray as sr

    vertices, faces = make_mesh()
    start = time.perf_counter()
    mesh = sr.Mesh(vertices=vertices, faces=faces)
    tree = mesh.tree()
    build = time.perf_counter() - start
    scene = sr.Scene(mesh)
    o, d = camera_rays()
    rays = {"coherent": (o, d), "diffuse": bounce_rays(scene, o, d)}

    tracers, absent = [sightray_tracer(scene, threads)], []
    for name, make in PEERS.items() if peers else ():
        try:
            tracers.append(make(vertices, faces, threads))
        except Exception as reason:
            absent.append(Result(name, (), f"{type(reason).__name__}: {reason}".splitlines()[0][:100]))

    # In turns, so that what else the machine does meets all alike; the first round warms up.
    times: dict[tuple[str, str], list[float]] = {(t.name, q): [] for t in tracers for q in QUESTIONS}
    for turn in range(rounds + 1):
        for question in QUESTIONS:
            kind, verb = question.split()
            for tracer in tracers:
                taken = seconds(getattr(tracer, verb), *rays[kind])
                if turn > 0:
                    times[tracer.name, question].append(taken)
    results = [
        Result(t.name, tuple(len(rays[q.split()[0]][0]) / 1e6 / float(np.median(times[t.name, q])) for q in QUESTIONS))
        for t in tracers
    ]
    bytes_each = sum(a.nbytes for a in (tree.tree.nodes, tree.blocks, tree.numbers)) / len(faces)
    facts = {
        "triangles": len(faces), "threads": threads, "coherent rays": len(o), "diffuse rays": len(rays["diffuse"][0]),
        "rounds": rounds, "build seconds, with compiling if not cached": round(build, 3),
        "bytes each triangle, tree and blocks": round(bytes_each, 1),
        "bytes each triangle, with vertices and faces": round(bytes_each + (24 * len(vertices)) / len(faces) + 12, 1),
    }  # fmt: skip
    return results + absent, facts


def rays(peers: bool, json: bool) -> None:
    """Measure rays each second through `Scene.intersect` and `Scene.occluded`, beside other ray tracers if asked."""
    from sightray.scene.parallel import core_count

    os.environ.setdefault("DRJIT_LIBLLVM_PATH", "/usr/lib/x86_64-linux-gnu/libLLVM-19.so")
    results, facts = measure(peers, core_count())
    if json:
        rows = [{"name": r.name, "absent": r.absent} | dict(zip(QUESTIONS, r.rates, strict=False)) for r in results]
        print(json_module.dumps({"facts": facts, "Mrays/s": rows}, indent=2))
        return
    print_rates(results, facts)


def print_rates(results: list[Result], facts: dict[str, Any]) -> None:
    """A table with our rates, and how many times those of each peer they are."""
    from rich.console import Console
    from rich.table import Table

    ours = results[0].rates
    table = Table(title="Mrays/s, NumPy arrays in and out; in brackets: sightray is that many times as fast")
    for heading in ("", *QUESTIONS):
        table.add_column(heading, justify="left" if not heading else "right")
    for result in results:
        cells = [f"{r:.1f} ({mine / r:.2f})" for r, mine in zip(result.rates, ours, strict=False)]
        table.add_row(result.name, *(cells or [f"absent: {result.absent}", "", "", ""]))
    console = Console()
    console.print(table)
    console.print(", ".join(f"{name}: {value:,}" for name, value in facts.items()))
