"""The ray examples that Open3D and trimesh publish, done with both sides in one test: the answers are the same.

These need the peers installed (``pip install open3d rtree``, and Debian's libusb-1.0-0): ``pytest -m peers``.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import sightray as sr

pytestmark = pytest.mark.peers


def open3d_scene(*meshes):
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    for v, f in meshes:
        scene.add_triangles(o3d.core.Tensor(np.float32(v)), o3d.core.Tensor(np.uint32(f)))
    return scene


def both(*meshes):
    """The same meshes, with vertices rounded to single precision, as they are in Open3D."""
    ours = sr.Scene(*[sr.Mesh(vertices=np.float32(v), faces=f) for v, f in meshes])
    return ours, open3d_scene(*meshes)


def parts(m):
    return np.asarray(m.vertices), np.asarray(m.faces)


def cube_and_ball():
    """The scene of the ray casting tutorial: a cube and, beside it, a sphere."""
    cube = trimesh.creation.box()
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    ball.apply_translation((1.5, 0.2, 0.1))
    return both(parts(cube), parts(ball))


def tutorial_rays(n=4000):
    rng = np.random.default_rng(1)
    o = np.float32(rng.normal(size=(n, 3)) * 3)
    d = np.float32(rng.uniform((-0.5, -0.5, -0.5), (2, 0.6, 0.6), (n, 3)) - o)
    return o, d, np.concatenate([o, d], axis=1)


def test_open3d_two_rays_at_a_cube():
    """Tutorial "Ray casting": the first two rays, of which one hits."""
    import open3d as o3d

    cube = o3d.geometry.TriangleMesh.create_box()
    v, f = np.asarray(cube.vertices), np.asarray(cube.triangles)
    ours, theirs = both((v, f))
    rays = np.array([[0.5, 0.5, 10, 0, 0, -1], [-1, -1, -1, 0, 0, -1]], np.float32)
    answer, hits = theirs.cast_rays(rays), ours.intersect(rays[:, :3], rays[:, 3:])
    np.testing.assert_allclose(hits.t, answer["t_hit"].numpy(), rtol=1e-6)  # theirs is 8.999999
    assert hits.t.tolist() == [9, np.inf]
    np.testing.assert_array_equal(hits.shape == -1, answer["geometry_ids"].numpy() == theirs.INVALID_ID)


def test_open3d_cast_rays():
    ours, theirs = cube_and_ball()
    o, d, rays = tutorial_rays()
    answer, hits = {k: v.numpy() for k, v in theirs.cast_rays(rays).items()}, ours.intersect(o, d)
    same = hits.hit == np.isfinite(answer["t_hit"])
    assert same.mean() > 0.999  # single precision decides otherwise at outlines
    hit = hits.hit & same
    np.testing.assert_allclose(hits.t[hit], answer["t_hit"][hit], rtol=1e-4)
    np.testing.assert_array_equal(hits.shape[hit], answer["geometry_ids"][hit])
    equal = hit & (hits.primitive == answer["primitive_ids"])
    assert equal.sum() > 0.99 * hit.sum()
    np.testing.assert_allclose(hits.uv[equal], answer["primitive_uvs"][equal], atol=1e-3)
    np.testing.assert_allclose(hits.normal[equal], answer["primitive_normals"][equal], atol=1e-4)


def test_open3d_occlusions_counts_and_lists():
    ours, theirs = cube_and_ball()
    o, d, rays = tutorial_rays()
    dark = theirs.test_occlusions(rays, tnear=0.0, tfar=0.9).numpy()
    assert (ours.occluded(o, d, 0.9) == dark).mean() > 0.999
    number = theirs.count_intersections(rays).numpy()
    same = ours.count(o, d) == number
    assert same.mean() > 0.998
    answer = {k: v.numpy() for k, v in theirs.list_intersections(rays).items()}
    layers = ours.intersect_all(o, d)
    for i in np.flatnonzero(same)[:500]:
        theirs_t = np.sort(answer["t_hit"][answer["ray_splits"][i] : answer["ray_splits"][i + 1]])
        np.testing.assert_allclose(layers.t[layers.of_ray(i)], theirs_t, rtol=1e-4)


def test_open3d_distances_and_occupancy():
    """Tutorial "Distance queries"."""
    ours, theirs = cube_and_ball()
    points = np.float32(np.random.default_rng(2).uniform((-1, -1, -1), (2.5, 1, 1), (4000, 3)))
    answer, near = theirs.compute_closest_points(points), ours.closest_point(points)
    np.testing.assert_allclose(near.point, answer["points"].numpy(), atol=1e-3)
    np.testing.assert_allclose(near.distance, theirs.compute_distance(points).numpy(), atol=1e-5)
    np.testing.assert_allclose(ours.signed_distance(points), theirs.compute_signed_distance(points).numpy(), atol=1e-5)
    np.testing.assert_array_equal(ours.contains(points), theirs.compute_occupancy(points).numpy() == 1)


def test_trimesh_ray_example():
    """examples/ray.py: two rays at an icosphere, and the calls around it."""
    ball = trimesh.primitives.Sphere().to_mesh()
    scene = sr.Scene(sr.Mesh(vertices=ball.vertices, faces=ball.faces))
    o, d = np.array([[0, 0, -3], [2, 2, -3]]), np.array([[0.01, 0.02, 1], [0, 0, 1]])
    query = trimesh.ray.ray_triangle.RayMeshIntersector(ball)
    where, ray, triangle = query.intersects_location(o, d, multiple_hits=True)
    layers = scene.intersect_all(o, d)
    np.testing.assert_array_equal(layers.ray, ray)
    order = np.argsort(where[:, 2])
    np.testing.assert_allclose(o[layers.ray] + layers.t[:, None] * d[layers.ray], where[order], atol=1e-9)
    np.testing.assert_array_equal(layers.primitive, triangle[order])
    np.testing.assert_array_equal(scene.intersect(o, d).primitive, query.intersects_first(o, d))
    np.testing.assert_array_equal(scene.occluded(o, d), query.intersects_any(o, d))
    np.testing.assert_array_equal(np.sort(query.intersects_id(o, d)[0]), np.sort(layers.primitive))


def test_trimesh_proximity():
    """examples/nearest.ipynb: nearest points on a mesh, signed distance, points inside."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    scene = sr.Scene(sr.Mesh(vertices=ball.vertices, faces=ball.faces))
    points = np.random.default_rng(3).uniform(-1.5, 1.5, (500, 3))
    where, distance, _ = trimesh.proximity.closest_point(ball, points)
    near = scene.closest_point(points)
    np.testing.assert_allclose(near.point, where, atol=1e-9)
    np.testing.assert_allclose(near.distance, distance, atol=1e-9)
    np.testing.assert_allclose(
        scene.signed_distance(points), -trimesh.proximity.signed_distance(ball, points), atol=1e-9
    )
    np.testing.assert_array_equal(scene.contains(points), ball.contains(points))
