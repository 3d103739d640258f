"""The edge of night on coarse smooth meshes: as round as the shading, and shadows stay where they belong."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr


def ball(steps=1, **options):
    """A unit icosahedron, refined, with the normals of the sphere."""
    g = (1 + math.sqrt(5)) / 2
    v = np.array([[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g], [0, -1, -g], [0, 1, -g],
                  [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]])  # fmt: skip
    f = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
         (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7),
         (9, 8, 1)]  # fmt: skip
    corners = v[np.array(f)].astype(float)
    for _ in range(steps):
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    points, faces = np.unique(corners.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return sr.Mesh(vertices=points, faces=faces.reshape(-1, 3), normals=points, **options)


CAMERA = sr.PerspectiveCamera(eye=(0, 0.8, 4), vfov=32, width=96, height=96)
LAMP = sr.PointLight(position=(4, 3, 0), intensity=60)
SHADED = {
    "Whitted": sr.Whitted(),
    "DirectLighting": sr.DirectLighting(),
    "PathTracer": sr.PathTracer(max_depth=1),
    "CoursePathTracer": sr.CoursePathTracer(max_depth=1),
}


def picture(integrator, *objects, camera=CAMERA):
    return np.asarray(sr.render(sr.Scene(*objects, camera=camera), integrator))[..., 0]


@pytest.mark.parametrize("name", SHADED)
@pytest.mark.parametrize("transform", [None, sr.Transform.scale(1.2, 0.8, 1.1), sr.Transform.rotate((1, 2, 3), 40)])
def test_no_staircase_between_day_and_night(name, transform):
    """A lone convex ball casts no shadow on its day side: with and without shadow rays it is the same."""
    mesh = ball(transform=transform)
    free = picture(sr.Whitted(shadows=False), mesh, LAMP)
    shaded = picture(SHADED[name], mesh, LAMP)
    lost = (free > 0.02) & (shaded < 0.5 * free)
    assert (free > 0.02).sum() > 1000
    assert lost.sum() < 0.01 * (free > 0.02).sum()
    np.testing.assert_allclose(shaded[~lost & (free > 0.02)], free[~lost & (free > 0.02)], rtol=1e-4)


def test_flat_meshes_keep_their_edges():
    """Without normals triangles that face away from the light are dark, as they must be."""
    mesh = ball()
    flat = sr.Mesh(vertices=mesh.vertices, faces=mesh.faces)
    np.testing.assert_allclose(
        picture(sr.Whitted(), flat, LAMP), picture(sr.Whitted(shadows=False), flat, LAMP), atol=1e-6
    )


@pytest.mark.parametrize("name", SHADED)
def test_shadows_of_others_stay(name):
    """A screen between lamp and ball darkens all of it, and one behind the lamp nothing."""
    mesh = ball()
    screen = sr.Disk(center=(2, 1.5, 0), normal=(4, 3, 0), radius=2)
    behind = sr.Disk(center=(4.4, 3.3, 0), normal=(4, 3, 0), radius=2)
    assert picture(SHADED[name], mesh, LAMP, screen)[30:70, 30:66].max() == 0
    np.testing.assert_array_equal(picture(SHADED[name], mesh, LAMP, behind)[30:70, 30:66],
                                  picture(SHADED[name], mesh, LAMP)[30:70, 30:66])  # fmt: skip


def test_shadow_rays_end_at_the_lamp():
    """Rays from above the point are aimed anew: a lamp that is seen does not stand in the way of its own light."""
    light = sr.RectangleLight(
        corner=(1.2, 0.9, -0.5), edge_u=(0, 0, 1), edge_v=(0.5, -0.5, 0), radiance=5, two_sided=True
    )
    seen, hidden = (
        picture(sr.DirectLighting(strategy="light"), ball(), light.replace(visible=v)) for v in (True, False)
    )
    inside = (slice(20, 76), slice(20, 88))
    np.testing.assert_allclose(seen[inside], hidden[inside], rtol=1e-6)
    assert seen[inside].max() > 0.1


def test_a_hollow_ball_is_lit_as_before():
    """From within, the shading is rounder towards the outside, where no ray may start."""
    camera = sr.PerspectiveCamera(eye=(0, 0, 0.3), target=(0, 0, -1), vfov=80, width=64, height=64)
    lamp = sr.PointLight(position=(0.2, 0.3, 0), intensity=1)
    image = picture(sr.Whitted(), ball(), lamp, camera=camera)
    free = picture(sr.Whitted(shadows=False), ball(), lamp, camera=camera)
    np.testing.assert_array_equal(image, free)
    assert image.min() > 0
