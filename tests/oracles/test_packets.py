"""Packets of sixteen rays find what single rays find, to the last bit, whatever the rays."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from sightray._jit import kernel, native
from sightray.bvh.casting import END, PACKET_WORDS, PRIM, cast_packet, share
from sightray.bvh.hulls import are_close, extremes
from sightray.bvh.packets import ROOM_WORDS, SPREAD, any_rays, closest_rays
from sightray.bvh.triangles import (
    LARGE,
    MESH_WORDS,
    SIZE,
    SMALL,
    TINY,
    any_triangle,
    build_mesh,
    closest_triangle,
    pack_mesh,
)
from sightray.mathlib.lanes import load8, movemask8, push_all8, sort8, splat8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Space, Table, advance, f64_at, f64_put, i64_at, scratch
from sightray.mathlib.vec import Vec3

LANES = np.arange(16)


@kernel
def coherent(mesh: Table, packet: Table, t_min: f64) -> bool:
    work, lanes = scratch(192), scratch(168)
    alive = cast_packet(mesh, packet, t_min, work, lanes)
    return alive == 0 or (share(packet, lanes, alive).same and are_close(extremes(lanes), SPREAD))


@kernel
def trace_both(mesh: Table, packets: Table, n: i64, together: i64, t_min: f64, single: Table, packet: Table) -> i64:
    """For each ray of n packets: t, triangle, whether anything is met, in two ways; how many are coherent."""
    copy, blocked, found, room = scratch(2048), scratch(16), scratch(16), scratch(ROOM_WORDS)
    side_by_side = 0
    for first in range(0, n, together):
        rays, count = advance(packets, first * 128), min(together, n - first)
        for word in range(128 * count):
            f64_put(copy, word, f64_at(rays, word))
        any_rays(mesh, copy, count, t_min, blocked, room)
        closest_rays(mesh, copy, count, t_min, found, room)
        for p in range(count):
            side_by_side += 1 if coherent(mesh, advance(rays, 128 * p), t_min) else 0
        for k in range(16 * count):
            i, at = k // 16 * 128 + k % 16, 3 * (16 * first + k)
            o = Vec3(f64_at(rays, i), f64_at(rays, 16 + i), f64_at(rays, 32 + i))
            d = Vec3(f64_at(rays, 48 + i), f64_at(rays, 64 + i), f64_at(rays, 80 + i))
            end = f64_at(rays, 96 + i)
            hit = closest_triangle(mesh, o, d, t_min, end)
            f64_put(single, at, hit.t)
            f64_put(single, at + 1, float(hit.prim))
            f64_put(single, at + 2, 1.0 if any_triangle(mesh, o, d, t_min, end) else 0.0)
            met = i64_at(found, k // 16) >> (k % 16) & 1 != 0
            f64_put(packet, at, f64_at(copy, 96 + i) if met else math.inf)
            f64_put(packet, at + 1, f64_at(copy, 112 + i) if met else -1.0)
            f64_put(packet, at + 2, 1.0 if i64_at(blocked, k // 16) >> (k % 16) & 1 != 0 else 0.0)
    return side_by_side


def packed(vertices, faces):
    space = Space()
    row = space.row(MESH_WORDS)
    pack_mesh(space, row, build_mesh(np.asarray(vertices, np.float64), np.asarray(faces, np.int32)))
    return space, row


def compare(row, o, d, end=math.inf, t_min=0.0, run=None, together=16):
    """Assert that packets and single rays agree; what they find, and the share of coherent packets. o, d: (n, 16, 3)."""
    assert (END, PRIM, PACKET_WORDS) == (96, 112, 128)
    o, d = np.broadcast_arrays(o, d)
    packets = np.zeros((len(o), 128))
    packets[:, :48], packets[:, 48:96] = (a.transpose(0, 2, 1).reshape(-1, 48) for a in (o, d))
    packets[:, 96:112] = end
    single, packet = np.empty((len(o), 16, 3)), np.empty((len(o), 16, 3))
    run = run or native(trace_both)
    coherent = run(row, Table(packets), len(o), together, t_min, Table(single), Table(packet))
    np.testing.assert_array_equal(packet, single)
    np.testing.assert_array_equal(single[..., 2], np.isfinite(single[..., 0]))
    return single, coherent / len(o)


def ball(scale=1.0, offset=0.0, subdivisions=4):
    shape = trimesh.creation.icosphere(subdivisions=subdivisions)
    bumps = 1 + 0.2 * np.sin(9 * shape.vertices[:, :1]) * np.cos(7 * shape.vertices[:, 1:2])
    return shape.vertices * bumps * scale + offset, shape.faces


def bundles(rng, n, width):
    """Origins around a ball of radius 1, and directions to it; sixteen rays side by side."""
    center = rng.normal(size=(n, 1, 3))
    center *= rng.uniform(0.5, 4.0, (n, 1, 1)) / np.linalg.norm(center, axis=2, keepdims=True)
    aim = rng.uniform(-0.8, 0.8, (n, 1, 3))
    o = center + width * rng.uniform(0, 1, (n, 1, 1)) * rng.normal(size=(n, 16, 3))
    return o, (aim + width * rng.normal(size=(n, 16, 3)) - o) * rng.uniform(0.1, 10.0, (n, 1, 1))


@pytest.mark.parametrize("width", [0.0, 1e-4, 1e-3, 5e-3, 0.03, 3.0])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_packets_find_what_single_rays_find(width, scale, offset):
    rng = np.random.default_rng(1)
    _space, row = packed(*ball(scale, offset))
    o, d = bundles(rng, 1500, width)
    found, coherent = compare(row, o * scale + offset, d * scale)
    assert 0.1 < np.isfinite(found[..., 0]).mean() < 1.0
    assert coherent > 0.5 if width <= 1e-3 else coherent < 0.9
    ends = np.random.default_rng(2).uniform(0.0, 1.5, (1500, 16))
    compare(row, o * scale + offset, d * scale, ends, t_min=0.2)


@pytest.mark.parametrize("together", [1, 3, 4, 7, 16])
@pytest.mark.parametrize("width", [1e-3, 4e-3, 0.02])
def test_packets_that_form_groups(width, together):
    """Four packets next to each other, of which one may go another way, or be without rays."""
    rng = np.random.default_rng(6)
    _space, row = packed(*ball())
    o, d = bundles(rng, 400, 0.0)
    o, d = (np.repeat(a, 4, axis=0) for a in (o, d))
    size = np.linalg.norm(d, axis=2, keepdims=True)
    d = d + width * size * (rng.normal(size=d.shape) * 0.3 + rng.normal(size=(len(d), 1, 3)))
    astray = rng.random(len(d)) < 0.2
    d[astray] = rng.normal(size=(astray.sum(), 16, 3))
    ends = np.where(rng.random((len(d), 1)) < 0.1, math.nan, rng.uniform(0.5, 4.0, (len(d), 16)))
    for end in (math.inf, ends):
        found, coherent = compare(row, o, d, end, together=together)
        assert 0.05 < coherent < 0.95
        assert 0.1 < np.isfinite(found[..., 0]).mean() < 1.0


def slivers(rng, n):
    """Long and thin triangles in all directions, whose boxes overlap."""
    start, along, aside = rng.uniform(-1, 1, (n, 3)), *rng.normal(size=(2, n, 3))
    vertices = np.stack([start, start + along, start + 1e-2 * aside], axis=1).reshape(-1, 3)
    return vertices, np.arange(3 * n).reshape(-1, 3)


@pytest.mark.parametrize("size", [TINY, SMALL, LARGE])
def test_rays_from_one_place_in_all_directions(size):
    """They begin together; among slivers they meet more boxes on their own than their stacks keep for later."""
    rng = np.random.default_rng(7)
    for vertices, faces in (ball(), slivers(rng, 6000)):
        _space, row = packed(vertices, faces)
        assert row.view(np.int64)[SIZE] == TINY
        row.view(np.int64)[SIZE] = size
        o = rng.uniform(-1, 1, (400, 1, 3)) * (1 + 1e-6 * rng.normal(size=(400, 16, 1)))
        d = rng.normal(size=(400, 16, 3)) * rng.uniform(0.1, 10, (400, 1, 1))
        d[:200] = d[:200, :1] + 0.3 * d[:200]  # about the same way, but not quite
        d[::7, ::3, 1] = 0.0
        for end in (math.inf, np.where(rng.random((400, 16)) < 0.2, math.nan, rng.uniform(0.0, 3.0, (400, 16)))):
            found, coherent = compare(row, o, d, end, t_min=0.01)
            assert coherent < 0.05
            assert 0.1 < np.isfinite(found[..., 0]).mean() < 0.99


def test_bundles_from_one_eye_through_edges_and_vertices():
    rng = np.random.default_rng(3)
    vertices, faces = ball(subdivisions=3)
    _space, row = packed(vertices, faces)
    corner = vertices[rng.integers(0, len(vertices), (3000, 1))]
    near = corner + 0.004 * rng.normal(size=(3000, 16, 3))
    face = faces[rng.integers(0, len(faces), (3000, 8))]
    w = rng.integers(0, 3, (3000, 8, 1)) / 2.0
    near[:, :8] = vertices[face[..., 0]] * w + vertices[face[..., 1]] * (1 - w)  # elsewhere: not coherent
    near[:1500, :8] = corner[:1500]
    for distance in (0.0, 1e2, 1e5):
        eye = 3.0 * corner * (1 + distance)
        found, coherent = compare(row, eye, near - eye)
        assert coherent > 0.2
        assert np.isfinite(found[:1500, :8, 0]).mean() > 0.9


def test_senseless_rays_and_empty_lanes_do_not_disturb_the_others():
    rng = np.random.default_rng(4)
    _space, row = packed(*ball())
    o, d = bundles(rng, 4000, 1e-3)
    end = np.full((4000, 16), math.inf)
    for k in range(4000):
        which = rng.random(16) < rng.uniform(0, 1)
        bad = rng.choice([math.nan, math.inf, -math.inf, 0.0, -0.0, 1e300, 1e-300])
        kind = k % 4
        if kind == 0:
            o[k, which, k % 3] = bad
        elif kind == 1:
            d[k, which, k % 3] = bad
        elif kind == 2:
            d[k, which] = bad
        else:
            end[k, which] = rng.choice([math.nan, -1.0, 0.0, 0.5, -math.inf])
    found, coherent = compare(row, o, d, end)
    assert coherent > 0.5
    assert np.isfinite(found[..., 0]).mean() > 0.2


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_axis_aligned_packets_on_a_grid(zero):
    """Along box faces, through vertices and edges, and rays that meet two triangles at the same place."""
    g = np.linspace(-1, 1, 17)
    x, y = (a.ravel() for a in np.meshgrid(g, g, indexing="ij"))
    vertices = np.concatenate([np.stack([x, y, x * 0], 1), np.stack([x, y, x * 0 - 0.5], 1)])
    cell = np.arange(16)[:, None] * 17 + np.arange(16)
    a = cell.ravel()
    faces = np.concatenate([np.stack([a, a + 17, a + 1], 1), np.stack([a + 17, a + 18, a + 1], 1)])
    faces = np.concatenate([faces, faces[::-1] + 289, faces])  # each of the upper layer twice
    _space, row = packed(vertices, faces)
    p = np.linspace(-1, 1, 65)
    o = np.stack([*np.meshgrid(p[:-1], p[:-1], indexing="ij"), np.full((64, 64), 3.0)], -1).reshape(-1, 16, 3)
    found, coherent = compare(row, o, np.array([zero, zero, -2.0]))
    assert (found[..., 0] == 1.5).all()
    assert (found[..., 1] < 512).all()  # of two at the same place, the first
    assert coherent == 0  # too wide
    tight = o[:, :1] + np.array([1 / 512, 1 / 512, 0]) * (LANES // 4)[:, None]
    found, coherent = compare(row, tight, np.array([zero, zero, -2.0]))
    assert coherent == 1
    assert (found[..., 0] == 1.5).all()
    for axis in range(2):
        compare(row, np.roll(tight, axis + 1, axis=-1), np.roll([zero, zero, -2.0], axis + 1))


def test_python_and_machine_code_agree():
    rng = np.random.default_rng(5)
    _space, row = packed(*ball(subdivisions=1))
    o, d = bundles(rng, 12, 1e-3)
    o[3, 2:9, 0], d[5, 3:, 1] = math.nan, 0.0
    slow, slow_coherent = compare(row, o, d, run=trace_both)
    fast, fast_coherent = compare(row, o, d)
    assert slow_coherent == fast_coherent > 0.5
    np.testing.assert_array_equal(slow[..., 1:], fast[..., 1:])
    np.testing.assert_allclose(slow[..., 0], fast[..., 0], rtol=1e-11)


@kernel
def sort_and_push(lengths: Table, codes: Table, stack: Table) -> i64:
    chosen = splat8(0.0) < load8(lengths, 8)
    push_all8(stack, 0, sort8(load8(lengths, 0), load8(codes, 0), chosen))
    return movemask8(chosen)


def test_children_are_sorted_by_distance():
    rng = np.random.default_rng(6)
    run, stack = native(sort_and_push), np.zeros(8, np.int64)
    for turn in range(200):
        chosen, lengths = rng.random(8) < 0.5, rng.choice([0.0, 1e-30, 0.5, 0.50000003, 2.0], 8).astype(np.float32)
        codes = rng.permutation(8).astype(np.int32) + (turn % 2 << 30)
        table = Table(np.concatenate([lengths, np.where(chosen, 1, -1).astype(np.float32)]))
        for call in (run, sort_and_push):
            assert call(table, Table(codes), Table(stack)) == np.packbits(chosen, bitorder="little")[0]
            found = stack[: chosen.sum()]
            near, code = (found >> 32).astype(np.int32).view(np.float32), (found & 0xFFFFFFFF).astype(np.int32)
            assert sorted(code) == sorted(codes[chosen])
            assert (np.diff(near) <= 0).all()
            true = lengths[np.argsort(codes)][code - codes.min()]
            assert (near <= true).all()  # cut, never rounded up: no child is left out that is near enough
            np.testing.assert_allclose(near, true, rtol=1e-6)
