"""E1, E2 and E11: labels belong to pixel centres, are exact, and depend on nothing else; for every camera model."""

from __future__ import annotations

import numpy as np
import pytest
from label_scenes import BALL, CRATE, OBJECTS, centres, every_camera, residuals, scene, sphere_distance

import sightray as sr
from sightray.registry import members
from sightray.vision.view import is_linear

EVERY = [pytest.param(camera, id=name) for name, camera in every_camera().items()]
HITS = ("depth", "distance", "position", "instance", "primitive", "normal", "ray_origin", "ray_direction")


def ready(camera):
    return sr.label(scene(camera), *HITS)


@pytest.mark.parametrize("camera", EVERY)
def test_e1_discrete_labels_are_those_of_the_rays_through_pixel_centres(camera):
    labels = ready(camera)
    origins, directions = camera.rays(centres(camera))
    np.testing.assert_allclose(labels.ray_origin, origins, atol=1e-13)
    np.testing.assert_allclose(labels.ray_direction, directions, atol=1e-13)
    hits = scene(camera).intersect(labels.ray_origin, labels.ray_direction)
    assert (labels.instance == hits.shape).all()
    assert (labels.primitive == hits.primitive).all()
    assert (labels.distance == hits.t).all()
    assert len(np.unique(labels.instance)) >= 5


@pytest.mark.parametrize("camera", EVERY)
def test_e2_points_lie_on_their_surfaces(camera):
    labels = ready(camera)
    met = labels.instance >= 0
    assert np.abs(residuals(labels.position, labels.instance)[met]).max() <= 1e-10
    assert np.isnan(labels.position[~met]).all()
    along = labels.ray_origin[met] + labels.distance[met][:, None] * labels.ray_direction[met]
    assert np.abs(along - labels.position[met]).max() <= 1e-12
    forward = camera.world_from_camera()[:3, 2]
    depth = (labels.position - camera.world_from_camera()[:3, 3]) @ forward
    np.testing.assert_allclose(labels.depth[met], depth[met], rtol=1e-12, atol=1e-13)
    assert (labels.depth[~met] == np.inf).all()
    assert (labels.distance[~met] == np.inf).all()


@pytest.mark.parametrize("camera", EVERY)
def test_e2_distances_of_a_sphere_and_a_plane_against_closed_forms(camera):
    o, d = camera.rays(centres(camera))
    labels = sr.label(scene(camera, BALL), "distance", "normal")
    expected = sphere_distance(o, d, BALL.center, BALL.radius)
    hit = np.isfinite(labels.distance)
    assert (hit == np.isfinite(expected)).all()
    assert hit.sum() > 30
    clear = hit & (np.abs((labels.normal * d).sum(-1)) > 0.02)  # a grazing ray's root has fewer digits
    np.testing.assert_allclose(labels.distance[clear], expected[clear], rtol=1e-12)
    floor = sr.label(scene(camera, OBJECTS[1]), "distance").distance
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (-0.4 - o[..., 1]) / d[..., 1]
    np.testing.assert_allclose(floor, np.where(t > 0, t, np.inf), rtol=1e-12)


QUADRIC = sr.Quadric(a=1.0, b=0.5, c=0.8, d=0.3, e=-0.2, f=0.1, g=0.2, h=-0.1, i=0.4, j=-1.2,
                     lower=(-3, -3, -3), upper=(3, 3, 3))  # fmt: skip


def first_root(coefficients: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The root near t of polynomials, highest power first, (n, degree + 1): Newton's method in extended precision."""
    t = np.asarray(t, np.longdouble)
    for _ in range(6):
        value, slope = np.zeros_like(t), np.zeros_like(t)
        for c in coefficients.T:
            value, slope = value * t + c, slope * t + value
        t = t - value / slope
    return t.astype(float)


@pytest.mark.parametrize("camera", EVERY)
@pytest.mark.parametrize("shape", [QUADRIC, sr.Torus(major_radius=0.9, minor_radius=0.35)], ids=["quadric", "torus"])
def test_e2_distances_of_a_quadric_and_a_torus_against_their_polynomials(camera, shape):
    """The least positive root of the ray's own polynomial: by eigenvalues, polished in extended precision."""
    labels = sr.label(scene(camera, shape), "distance", "normal")
    o, d = (v.reshape(-1, 3).astype(np.longdouble) for v in camera.rays(centres(camera)))
    if isinstance(shape, sr.Torus):
        oo, od = (o * o).sum(-1), (o * d).sum(-1)  # (|p|² + R² - r²)² = 4 R² (x² + z²), |d| = 1
        k, four = oo + np.longdouble(0.9) ** 2 - np.longdouble(0.35) ** 2, 4 * np.longdouble(0.9) ** 2
        across = [d[:, 0] ** 2 + d[:, 2] ** 2, 2 * (o[:, 0] * d[:, 0] + o[:, 2] * d[:, 2]), o[:, 0] ** 2 + o[:, 2] ** 2]
        terms = [np.ones_like(k), 4 * od, 4 * od * od + 2 * k - four * across[0], 4 * k * od - four * across[1],
                 k * k - four * across[2]]  # fmt: skip
    else:
        q = np.array([[shape.a, shape.d / 2, shape.e / 2], [shape.d / 2, shape.b, shape.f / 2],
                      [shape.e / 2, shape.f / 2, shape.c]], np.longdouble)  # fmt: skip
        along = np.array([shape.g, shape.h, shape.i], np.longdouble)
        terms = [
            ((d @ q) * d).sum(-1),
            2 * ((o @ q) * d).sum(-1) + d @ along,
            ((o @ q) * o).sum(-1) + o @ along + shape.j,
        ]
    coefficients = np.stack(terms, axis=1)
    found = labels.distance.ravel()
    expected = np.full(len(o), np.inf)
    for i in np.flatnonzero(d.any(axis=1)):
        roots = np.roots(coefficients[i].astype(float))
        real = roots.real[(np.abs(roots.imag) < 1e-7) & (roots.real > 1e-9)]
        if len(real):
            expected[i] = first_root(coefficients[i : i + 1], real.min()[None])[0]
    hit = np.isfinite(found)
    clear = hit & (np.abs((labels.normal.reshape(-1, 3) * d).sum(-1)) > 0.05)  # a grazing ray's root has fewer digits
    assert clear.sum() > 30
    np.testing.assert_allclose(found[clear], expected[clear], rtol=1e-12)
    assert (np.isfinite(expected) != hit).mean() < 0.005  # where the ray touches


@pytest.mark.parametrize("camera", EVERY)
def test_e2_distance_is_depth_times_the_length_of_the_line_of_sight(camera):
    if not is_linear(camera):
        return  # cameras without a matrix have no such law
    labels = ready(camera)
    pixels = np.concatenate([centres(camera), np.ones((camera.height, camera.width, 1))], axis=-1)
    length = np.linalg.norm(pixels @ np.linalg.inv(camera.intrinsics()).T, axis=-1)
    met = labels.instance >= 0
    np.testing.assert_allclose(labels.distance[met], (labels.depth * length)[met], rtol=1e-12)


@pytest.mark.parametrize("camera", EVERY)
def test_normals_are_gradients_and_turn_with_the_camera(camera):
    labels = sr.label(scene(camera), "normal", "normal_camera", "position", "position_camera", "instance")
    ball = labels.instance == 0
    np.testing.assert_allclose(labels.normal[ball], (labels.position[ball] - BALL.center) / BALL.radius, atol=1e-12)
    pose = camera.world_from_camera()
    met = labels.instance >= 0
    np.testing.assert_allclose(np.linalg.norm(labels.normal[met], axis=-1), 1, rtol=1e-14)
    np.testing.assert_allclose(labels.normal_camera[met], labels.normal[met] @ pose[:3, :3], atol=1e-14)
    np.testing.assert_allclose(
        labels.position_camera[met], (labels.position[met] - pose[:3, 3]) @ pose[:3, :3], atol=1e-12
    )


ROUND = {
    "sphere": sr.Sphere(center=(0.3, -0.2, 0.1), radius=0.7),
    "disk": sr.Disk(center=(0.2, 0.1, -0.3), normal=(1, 2, -1), radius=0.6),
    "cone": sr.Cone(base=(0.1, -0.4, 0.2), top=(0.5, 0.6, -0.3), base_radius=0.5, top_radius=0.2),
    "cylinder": sr.Cylinder(base=(0.1, -0.4, 0.2), top=(0.5, 0.6, -0.3), radius=0.35),
    "torus": sr.Torus(center=(0.1, 0.2, 0), axis=(1, 1, 0.5), major_radius=0.6, minor_radius=0.2),
    "rectangle": sr.Rectangle(corner=(0.1, 0.2, 0.3), edge_u=(0.5, 0.2, 0), edge_v=(-0.1, 0.4, 0.3)),
    "triangle": sr.Triangle(a=(0, 0, 0), b=(1, 0.3, 0.1), c=(0.2, 0.8, -0.4)),
    "polygon": sr.Polygon(outline=[(0, 0, 0), (1, 0, 0.5), (1, 1, 0.5), (0.5, 0.4, 0.25), (0, 1, 0)]),
    "box": sr.Box(lower=(-0.2, 0, 0.1), upper=(0.5, 0.3, 0.9)),
}


@pytest.mark.parametrize("kind", ROUND)
def test_boxes_in_space_are_tight_in_turned_groups_too(kind):
    """Of 20 000 rays along each axis, both ways, none meets the turned shape beyond its box, and some do near each side."""
    turn = sr.Transform.rotate((1, 2, 3), 50) @ sr.Transform.scale(1.0, 1.6, 0.7)
    group = sr.Group(objects=[ROUND[kind].replace(transform=turn)], name="group")
    labels = sr.label(sr.Scene(group, camera=every_camera()["PerspectiveCamera"]), "boxes_3d")
    thing = labels.objects[0]
    size = (thing.upper - thing.lower).max()
    start = np.random.default_rng(5).uniform(thing.lower, thing.upper, (20_000, 3))
    found = []
    for axis in range(3):
        for way in (1, -1):
            o, d = start.copy(), np.zeros(3)
            o[:, axis], d[axis] = (thing.lower - 3 * size)[axis] if way > 0 else (thing.upper + 3 * size)[axis], way
            hits = sr.Scene(group).intersect(o, d)
            met = np.isfinite(hits.t)
            found.append(o[met] + hits.t[met, None] * d)
    found = np.concatenate(found)
    assert (found >= thing.lower - 1e-9).all()
    assert (found <= thing.upper + 1e-9).all()
    slack = 0.03 * size  # corners of flat shapes are met by few rays
    assert (found.min(axis=0) <= thing.lower + slack).all()
    assert (found.max(axis=0) >= thing.upper - slack).all()


def test_amodal_boxes_may_reach_beyond_the_picture():
    """Of a ball that the left edge cuts, the whole outline as the camera's cone sees it; within the picture, the same."""
    camera = sr.PinholeCamera(fx=60, width=64, height=48)
    ball = sr.Sphere(center=(-2.0, 0.1, 4), radius=0.7, name="ball")
    room = sr.Scene(ball, sr.Sphere(center=(0.5, 0, 4), radius=0.3), camera=camera)
    inside = sr.label(room, "amodal_boxes").amodal_boxes
    whole = sr.label(room, sr.AmodalBoxesLayer(beyond=True)).amodal_boxes
    np.testing.assert_array_equal(inside[1], whole[1])
    assert whole[0, 0] < inside[0, 0] == 0
    np.testing.assert_array_equal(np.clip(whole[0], 0, (64, 48, 64, 48)), inside[0])
    x, _, z = (np.linalg.inv(camera.world_from_camera()) @ (*ball.center, 1))[:3]
    heading, half = np.arctan2(x, z), np.arcsin(0.7 / np.hypot(x, z))
    left, right = 32 + 60 * np.tan(heading - half), 32 + 60 * np.tan(heading + half)
    assert left - 0.5 <= whole[0, 0] <= left + 1.5
    assert right - 1.5 <= whole[0, 2] <= right + 0.5


def test_e2_points_of_meshes_are_told_by_their_triangles():
    labels = sr.label(scene(every_camera()["PerspectiveCamera"]), "primitive", "uv", "object_position", "instance")
    crate = labels.instance == 4
    corners = CRATE.vertices[CRATE.faces[labels.primitive[crate]]]
    u, v = labels.uv[crate].T[..., None]
    points = corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v
    np.testing.assert_allclose(labels.object_position[crate], points, atol=1e-14)


def test_object_coordinates_fill_the_unit_cube_by_the_boxs_diagonal():
    labels = sr.label(scene(every_camera()["PerspectiveCamera"]), "object_coordinates", "object_position", "instance")
    for thing in labels.objects:
        there = labels.instance == thing.index
        if np.isfinite(thing.upper).all():
            middle, diagonal = (thing.lower + thing.upper) / 2, np.linalg.norm(thing.upper - thing.lower)
            expected = (labels.object_position[there] - middle) / diagonal + 0.5
            np.testing.assert_allclose(labels.object_coordinates[there], expected, atol=1e-14)
            assert 0 <= expected.min() <= expected.max() <= 1
        else:
            assert np.isnan(labels.object_coordinates[there]).all()
    assert (
        np.abs(labels.object_position[labels.instance == 3] ** 2 @ np.ones(3) - 1).max() <= 1e-12
    )  # the egg's unit sphere


# ------------------------------------------------------------------------------------------------------ masks and boxes


def test_e1_masks_are_disjoint_and_parts_of_the_amodal_ones():
    things = (*OBJECTS, sr.Sphere(center=(0.3, 0.5, -1.5), radius=0.9))
    wanted = ("visible_masks", "amodal_masks", "instance", "visible_boxes", "amodal_boxes")
    labels = sr.label(scene(every_camera()["PerspectiveCamera"], *things), *wanted)
    assert (labels.visible_masks.sum(axis=0) == (labels.instance >= 0)).all()
    assert not (labels.visible_masks & ~labels.amodal_masks).any()
    hidden = labels.amodal_masks & ~labels.visible_masks
    assert hidden[[1, 5]].any(axis=(1, 2)).all()  # the floor and the sphere behind the ball
    for k, thing in enumerate(labels.objects):
        alone = sr.label(scene(labels.camera, things[thing.index]), "visible_masks", "visible_boxes")
        assert (labels.amodal_masks[k] == alone.visible_masks[0]).all()
        assert (labels.amodal_boxes[k] == alone.visible_boxes[0]).all()
        rows, columns = np.nonzero(labels.visible_masks[k])
        box = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
        assert (labels.visible_boxes[k] == box).all()


def test_boxes_of_what_is_not_seen_are_nan():
    camera = every_camera()["PerspectiveCamera"]
    away = sr.Sphere(center=(50, 0, 0), name="away")
    labels = sr.label(scene(camera, BALL, away), "visible_boxes", "amodal_boxes")
    assert np.isnan(labels.visible_boxes[1]).all()
    assert np.isnan(labels.amodal_boxes[1]).all()


@pytest.mark.parametrize("samples", [1, 3, 4, 7])
def test_e1_coverage_sums_to_one_and_measures_areas(samples):
    camera = sr.OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), view_height=3.0, width=24, height=24)
    disk = sr.Sphere(radius=1.0)
    labels = sr.label(sr.Scene(disk, camera=camera), sr.CoverageLayer(samples=samples), "instance")
    assert labels.coverage.shape == (24, 24, 2)
    assert np.abs(labels.coverage.sum(axis=-1) - 1).max() <= 1e-12
    area = labels.coverage[..., 0].sum() * (3 / 24) ** 2
    assert abs(area - np.pi) < 0.15 / samples
    if samples == 1:
        assert ((labels.coverage[..., 0] == 1) == (labels.instance == 0)).all()
    whole = labels.coverage[..., 0] == 1
    assert (labels.instance[whole] == 0).all()


def test_coverage_rays_are_the_cells_middles():
    camera = every_camera()["PerspectiveCamera"]
    labels = sr.label(scene(camera), sr.CoverageLayer(samples=4))
    large = sr.label(scene(camera.resized(4 * camera.width, 4 * camera.height)), "instance").instance
    shares = (large.reshape(camera.height, 4, camera.width, 4) == 2).mean(axis=(1, 3))
    assert (labels.coverage[..., 2] == shares).all()
    assert ((shares > 0) & (shares < 1)).any()


# -------------------------------------------------------------------------------------------------- what does not matter


@pytest.mark.parametrize("name", ["PerspectiveCamera", "OrthographicCamera"])
def test_e11_labels_do_not_depend_on_threads(name):
    camera = every_camera()[name].resized(123, 77)
    room = scene(camera, *OBJECTS, sr.RectangleLight(corner=(-1, 4, -1), edge_u=(2, 0, 0), edge_v=(0, 0, 2)))
    after = scene(camera, *OBJECTS, sr.RectangleLight(corner=(-1, 4, -1), edge_u=(2, 0, 0), edge_v=(0, 0, 2)))
    wanted = [*HITS, "flow", "coverage", "occlusion", "light_visibility", "surfaces", "irradiance"]
    first, *others = (sr.label(room, *wanted, next=after, threads=threads) for threads in (1, 2, 5))
    for other in others:
        for label in wanted:
            a, b = first[label], other[label]
            for x, y in zip(a, b, strict=True) if isinstance(a, tuple) else [(a, b)]:
                assert x.tobytes() == y.tobytes(), label


def test_e11_labels_do_not_depend_on_the_tiles():
    """A window of a picture holds the picture's labels: its rays start elsewhere in their tiles."""
    camera = sr.PinholeCamera(fx=100, cx=50, cy=40, width=100, height=80, pose=every_camera()["PinholeCamera"].pose)
    window = camera.replace(cx=50 - 13, cy=40 - 21, width=50, height=33)
    whole, part = (sr.label(scene(c), "instance", "primitive", "depth", "normal") for c in (camera, window))
    assert (whole.instance[21:54, 13:63] == part.instance).all()
    assert (whole.primitive[21:54, 13:63] == part.primitive).all()
    np.testing.assert_allclose(whole.depth[21:54, 13:63], part.depth, rtol=1e-13)
    np.testing.assert_allclose(whole.normal[21:54, 13:63], part.normal, atol=1e-12)


def test_packets_and_single_rays_find_the_same():
    """Few meshes are asked in packets, many items one ray at a time."""
    camera = every_camera()["PerspectiveCamera"].resized(90, 70)
    far = [sr.Sphere(center=(100 + k, 0, 0), radius=0.1) for k in range(40)]
    few, many = sr.label(scene(camera), *HITS), sr.label(scene(camera, *OBJECTS, *far), *HITS)
    for label in HITS:
        assert few[label].tobytes() == many[label].tobytes(), label


def test_every_layer_has_a_label_of_its_own_and_a_description():
    kinds = [kind for kind in members("vision.layers").values() if kind.__module__.startswith("sightray.")]
    assert len({kind.label for kind in kinds}) == len(kinds) > 40
    for kind in kinds:
        assert kind.label, kind
        assert len(kind.summary()) > 20, kind
