"""Ray tracers that ``sightray bench rays`` compares: this one, and those others that are installed.

All take NumPy arrays of single precision and give back NumPy arrays: t (beyond 1e30 for a miss) and triangle for the
nearest hit, a truth value for any. Making one builds its tree.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sightray.cli.bench_cases import Case

Cast = Callable[[np.ndarray, np.ndarray], Any]


class Unable(Exception):
    """A tracer that is installed cannot show what a case shows."""


class Tracer(NamedTuple):
    """One way to trace: two functions of origins and directions, (n, 3) float32."""

    name: str
    closest: Cast
    any: Cast


def plain_mesh(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """The mesh of a case that shows nothing but one, where it stands."""
    if case.spheres is not None:
        raise Unable("no spheres")
    if case.mesh is None or case.places is not None:
        raise Unable("no instances")
    return case.mesh


def sightray_tracer(case: Case, threads: int) -> Tracer:
    """This library, through the calls that everybody makes."""
    import sightray as sr

    scene = case.scene.replace()  # of which nothing is prepared yet
    if case.mesh is not None and case.places is None:  # from the arrays, as the others
        scene = sr.Scene(sr.Mesh(vertices=case.mesh[0], faces=case.mesh[1]))

    def closest(o: np.ndarray, d: np.ndarray) -> Any:
        hits = scene.intersect(o, d, threads=threads)
        return hits.t, hits.primitive

    return Tracer("sightray", closest, lambda o, d: scene.occluded(o, d, threads=threads))


def open3d_tracer(case: Case, threads: int) -> Tracer:
    """Open3D's RaycastingScene: Embree 4, many rays at a time."""
    import open3d as o3d

    vertices, faces = plain_mesh(case)
    tensor = o3d.core.Tensor
    scene = o3d.t.geometry.RaycastingScene(nthreads=threads)
    scene.add_triangles(tensor(vertices), tensor(faces.astype(np.uint32)))

    def closest(o: np.ndarray, d: np.ndarray) -> Any:
        answer = scene.cast_rays(tensor(np.concatenate([o, d], axis=1)), nthreads=threads)
        return answer["t_hit"].numpy(), answer["primitive_ids"].numpy()

    def occluded(o: np.ndarray, d: np.ndarray) -> Any:
        return scene.test_occlusions(tensor(np.concatenate([o, d], axis=1)), nthreads=threads).numpy()

    return Tracer(f"Open3D {o3d.__version__} (Embree 4)", closest, occluded)


def mitsuba_tracer(case: Case, threads: int) -> Tracer:
    """Mitsuba 3, llvm: Embree with packets of sixteen."""
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", "/usr/lib/x86_64-linux-gnu/libLLVM-19.so")
    import drjit
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    drjit.set_thread_count(threads)
    parts: dict[str, Any] = {}
    if case.spheres is not None:
        for i, (x, y, z, radius) in enumerate(case.spheres.tolist()):
            parts[f"sphere{i}"] = {"type": "sphere", "center": [x, y, z], "radius": radius}
    if case.mesh is not None:
        vertices, faces = case.mesh
        mesh = mi.Mesh("mesh", len(vertices), len(faces))
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"], parameters["faces"] = vertices.ravel(), faces.astype(np.uint32).ravel()
        parameters.update()
        parts["mesh"] = mesh
    if case.places is not None:
        parts = {"group": {"type": "shapegroup", **parts}}
        for i, matrix in enumerate(case.places):
            place = mi.ScalarTransform4f(matrix)
            parts[f"place{i}"] = {"type": "instance", "to_world": place, "of": {"type": "ref", "id": "group"}}
    scene = mi.load_dict({"type": "scene", **parts})

    def rays(o: np.ndarray, d: np.ndarray) -> Any:
        return mi.Ray3f(mi.Point3f(np.ascontiguousarray(o.T)), mi.Vector3f(np.ascontiguousarray(d.T)))

    def closest(o: np.ndarray, d: np.ndarray) -> Any:
        found = scene.ray_intersect_preliminary(rays(o, d), coherent=False)
        drjit.eval(found)
        return found.t.numpy(), found.prim_index.numpy()

    return Tracer(f"Mitsuba {mi.__version__} (llvm)", closest,
                  lambda o, d: scene.ray_test(rays(o, d), coherent=False).numpy())  # fmt: skip


def embreex_tracer(case: Case, threads: int) -> Tracer:
    """embreex: Embree 4, one ray at a time on one thread."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, *plain_mesh(case))

    def closest(o: np.ndarray, d: np.ndarray) -> Any:
        answer = scene.run(o, d, output=1)
        return np.where(answer["primID"] >= 0, answer["tfar"], np.inf), answer["primID"]

    return Tracer("embreex, 1 thread", closest, lambda o, d: scene.run(o, d, query="OCCLUDED"))


def trimesh_tracer(case: Case, threads: int) -> Tracer:
    """trimesh, with embreex if that is there."""
    import trimesh

    mesh = trimesh.Trimesh(*plain_mesh(case), process=False)

    def closest(o: np.ndarray, d: np.ndarray) -> Any:
        primitive = mesh.ray.intersects_first(o, d)
        return np.where(primitive >= 0, 0.0, np.inf), primitive  # it tells no t

    return Tracer(f"trimesh {trimesh.__version__}", closest, mesh.ray.intersects_any)


PEERS = {
    "Open3D": open3d_tracer, "Mitsuba": mitsuba_tracer, "embreex": embreex_tracer, "trimesh": trimesh_tracer,
}  # fmt: skip
