"""Tiles of labels: sixteen pixels computed together are what each is on its own, and memory is lent, not shared."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel, native
from sightray.cameras.base import sight_ray
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, vec3_put
from sightray.scene.compile import Tables
from sightray.vision import shelf

PLACE = sr.Transform.translate(0.2, 0.1, -0.4) @ sr.Transform.rotate((1, 2, 3), 50) @ sr.Transform.scale(1.3, 0.8, 1)
SIZE = {"width": 83, "height": 61}  # with tiles at the borders that are not full


def waves(steps: int, height: float = 0.3) -> sr.Mesh:
    """A wavy square of 2 `steps`² triangles."""
    x, y = np.meshgrid(*2 * [np.linspace(-1, 1, steps + 1)])
    corner = (np.arange(steps)[:, None] * (steps + 1) + np.arange(steps)).ravel()
    faces = [corner + np.array([[0], [1], [steps + 2]]), corner + np.array([[0], [steps + 2], [steps + 1]])]
    vertices = np.stack([x, y, height * np.sin(3 * x) * np.cos(2 * y)], axis=-1).reshape(-1, 3)
    return sr.Mesh(vertices=vertices, faces=np.concatenate([part.T for part in faces]))


def scenes() -> dict[str, sr.Scene]:
    """Triangles as large as the picture and as small as a pixel, in their place or not; shapes beside them."""
    eye = {"eye": (0.3, 0.6, 3), "target": (0, 0, 0)}
    return {
        "large triangles": sr.Scene(waves(2), waves(3).replace(transform=PLACE), camera=sr.PerspectiveCamera(**eye, **SIZE)),
        "small triangles": sr.Scene(
            waves(60), waves(40).replace(transform=PLACE), camera=sr.PerspectiveCamera(**eye, **SIZE, shutter_close=0.2)
        ),
        "shapes": sr.Scene(
            waves(4).replace(transform=PLACE), sr.Box(lower=(-1, -1, -1), upper=(-0.2, -0.3, 1), transform=PLACE),
            sr.Disk(center=(0.5, 0.5, 0.6), radius=0.4), sr.Sphere(center=(-0.5, 0.4, 0.4), radius=0.4, transform=PLACE),
            sr.Rectangle(corner=(0, -1, 0.5)), sr.Cylinder(base=(0.8, -0.6, 0), top=(1, 0, 0.5), radius=0.3),
            sr.Triangle(a=(-1, 0.6, 0.5), b=(-0.2, 0.7, 0.4), c=(-0.6, 1.2, 0.3)), sr.Plane(point=(0, -1, 0)),
            camera=sr.PinholeCamera(fx=70, pose=sr.PerspectiveCamera(**eye).world_from_camera(), **SIZE),
        ),
        "cornell": sr.load("cornell").replace(camera=sr.load("cornell").camera.resized(83, 61)),
    }  # fmt: skip


@pytest.mark.parametrize("name", scenes())
def test_what_is_described_together_is_to_the_last_bit_what_queries_say_of_each_ray(name):
    scene = scenes()[name]
    labels = sr.label(scene, "ray_origin", "ray_direction", "position", "normal", "instance", "primitive", "distance")
    hits = scene.intersect(labels.ray_origin, labels.ray_direction)
    met = labels.instance >= 0
    assert 0.2 < met.mean()
    np.testing.assert_array_equal(labels.instance, hits.shape)
    np.testing.assert_array_equal(labels.primitive[met], hits.primitive[met])
    for layer, one_by_one in (("distance", hits.t), ("position", hits.position), ("normal", hits.normal)):
        np.testing.assert_array_equal(labels[layer][met], one_by_one[met], err_msg=layer)
    # Which layers are asked for changes nothing.
    detailed = sr.label(scene, "position", "normal", "uv", "shading_normal")
    for layer in ("position", "normal"):
        np.testing.assert_array_equal(detailed[layer], labels[layer])
    np.testing.assert_array_equal(detailed.uv[met], hits.uv[met])


@kernel
def ask(camera: Table, count: i64, pixels: Table, rays: Table) -> i64:
    """`sight_ray` for many pixels."""
    for i in range(count):
        ray = sight_ray(camera, f64_at(pixels, 2 * i), f64_at(pixels, 2 * i + 1), 0.5, 0.5, 0.5)
        vec3_put(rays, 8 * i, ray.origin)
        vec3_put(rays, 8 * i + 4, ray.direction)
    return count


@pytest.mark.parametrize("name", scenes())
def test_rays_of_a_tile_are_the_cameras_own_to_the_last_bit(name):
    scene = scenes()[name]
    labels, tables = sr.label(scene, "ray_origin", "ray_direction"), Tables()
    row = tables.row_of(scene.camera)
    tables.prepare(ask)
    pixels = np.stack(np.meshgrid(np.arange(83) + 0.5, np.arange(61) + 0.5), axis=-1).reshape(-1, 2)
    rays = np.empty((len(pixels), 8))
    native(ask)(row, len(pixels), Table(pixels), Table(rays))
    np.testing.assert_array_equal(labels.ray_origin.reshape(-1, 3), rays[:, :3])
    np.testing.assert_array_equal(labels.ray_direction.reshape(-1, 3), rays[:, 4:7])


def test_flow_of_a_still_scene_is_that_of_one_whose_things_are_stated_again():
    """The short way, where nothing has moved, and the long one; both leave the background's alone."""
    scene = scenes()["shapes"]
    after = scene.camera.replace(pose=sr.Transform.translate(0.1, 0, 0.2) @ scene.camera.pose)
    again = scene.replace(objects=tuple(thing.replace() for thing in scene.objects), camera=after)
    short, long = sr.label(scene, "flow", next=after).flow, sr.label(scene, "flow", next=again).flow
    np.testing.assert_allclose(short, long, rtol=0, atol=1e-11)
    assert np.nanmax(np.abs(short)) > 1
    moved = again.replace(objects=(again.objects[0].replace(transform=sr.Transform.translate(0, 0.3, 0) @ PLACE),
                                   *again.objects[1:]))  # fmt: skip
    different = np.abs(sr.label(scene, "flow", next=moved).flow - short).max(axis=-1) > 1e-6
    np.testing.assert_array_equal(different, sr.label(scene, "instance").instance == 0)


# --------------------------------------------------------------------------------------------------------------- memory


def test_labels_go_with_their_last_reference():
    """Not when Python looks for circles of references: until then their memory would be lost to the next ones."""
    scene = scenes()["cornell"]
    sr.label(scene, "depth", "flow", next=scene.camera)
    gc.collect()
    gc.disable()
    try:
        labels = sr.label(scene, "depth", "flow", next=scene.camera)
        depth = weakref.ref(labels.depth)
        del labels
        assert depth() is None
    finally:
        gc.enable()


def test_memory_is_lent_again_when_nobody_refers_to_it_and_not_before():
    shape = (257, 101, 3)
    first = shelf.empty(shape, np.float64)
    assert first.shape == shape
    assert first.dtype == np.float64
    assert first.flags.c_contiguous
    assert first.flags.writeable
    place, part = first.ctypes.data, first[3:5, :, 1]
    part[:] = 7.0
    del first
    other = shelf.empty(shape, np.float64)
    other[:] = 1.0
    assert other.ctypes.data != place
    assert (part == 7.0).all()
    del part
    assert shelf.empty(shape, np.float64).ctypes.data == place
    assert shelf.empty((10,), np.int32).base is None  # what is small comes from the system


def test_no_more_memory_is_kept_than_stated():
    held = [shelf.empty((1 << 20,), np.float64) for _ in range(12)]
    assert sum(raw.nbytes for raw in shelf._shelf) <= shelf.KEPT
    large = shelf.empty((shelf.KEPT,), np.int16)
    assert large.nbytes > shelf.KEPT
    assert len(shelf._shelf) == 1
    small = shelf.empty((1 << 20,), np.float64)
    del large
    assert sum(raw.nbytes for raw in shelf._shelf) <= shelf.KEPT
    assert len({a.ctypes.data for a in [*held, small]}) == 13


def test_labels_that_are_kept_are_not_written_by_the_next_ones():
    scene = scenes()["cornell"]
    scene = scene.replace(camera=scene.camera.resized(320, 240))
    kept = sr.label(scene, "depth", "normal")
    before = kept.depth.copy(), kept.normal.copy()
    for k in range(3):
        there = scene.camera.replace(vfov=20 + k)
        sr.label(scene, "depth", "normal", camera=there)
    np.testing.assert_array_equal(kept.depth, before[0])
    np.testing.assert_array_equal(kept.normal, before[1])
