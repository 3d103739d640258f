"""The centre rays of a tile: the camera's own, so that every camera model works.

They are written to the records, and to four packets of sixteen rays (see `bvh.casting`), one for each 4 x 4 pixels. Rays of
a pinhole whose rows share one time are computed sixteen at a time, with the operations of its `generate_ray` in their order:
they are the same to the last bit.
"""

from __future__ import annotations

from typing import Any

from sightray._jit import kernel
from sightray.bvh.casting import DIRECTION as PACKET_DIRECTION
from sightray.bvh.casting import ORIGIN as PACKET_ORIGIN
from sightray.bvh.casting import PACKET_WORDS
from sightray.cameras.base import (
    _CORNER,
    _DOWN,
    _EYE,
    _RIGHT,
    SHUTTER_CLOSE,
    SHUTTER_OPEN,
    generate_pinhole_ray,
    generate_ray,
    sight_ray,
)
from sightray.mathlib.lanes import F64x16, load16d, product16d, splat16d, sqrt16d, store16d
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import (
    Table,
    advance,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    is_null,
    scratch,
    table_at,
    vec3_at,
    vec3_put,
)
from sightray.mathlib.vec import Vec3
from sightray.scene.packet_kernels import put_lane
from sightray.vision.record import (
    BLOCK,
    CAMERA,
    COLUMNS,
    DIRECTION,
    LATTICE,
    ORIGIN,
    PIXEL,
    ROWS,
    SCALE,
    SIDE,
    X,
    Y,
    record_at,
)


def has_plane(camera: Any) -> bool:
    """Whether all rays leave one point at one time, in directions that are linear in the pixel."""
    return type(camera).kernels[generate_ray] is generate_pinhole_ray and camera.readout == 0


@kernel
def place_pixels(frame: Table, tile: i64, records: Table) -> i64:
    """Number the pixels of a tile, four squares of 4 x 4 one after the other; how many are in the picture."""
    columns, rows, scale = i64_at(frame, COLUMNS), i64_at(frame, ROWS), float(i64_at(frame, SCALE))
    across = (columns + SIDE - 1) // SIDE
    left, top = tile % across * SIDE, tile // across * SIDE
    middles, count = scratch(16), 0
    for k in range(SIDE):
        f64_put(middles, k, (left + k + 0.5) / scale)
        f64_put(middles, SIDE + k, (top + k + 0.5) / scale)
    for k in range(BLOCK):
        column, row = (k & 3) + 4 * ((k >> 4) & 1), ((k >> 2) & 3) + 4 * (k >> 5)
        if left + column < columns and top + row < rows:
            record = record_at(records, count)
            i64_put(record, PIXEL, (top + row) * columns + left + column)
            f64_put(record, X, f64_at(middles, column))
            f64_put(record, Y, f64_at(middles, SIDE + row))
            count += 1
    return count


@kernel
def generate_rays(frame: Table, records: Table, packets: Table, count: i64) -> None:
    """The ray of sight through each pixel's centre, the lens's centre, at the middle of the exposure."""
    if count == BLOCK and not is_null(table_at(frame, LATTICE)):
        for p in range(4):
            generate_sixteen(frame, records, 16 * p, advance(packets, p * PACKET_WORDS))
        return
    camera = table_at(frame, CAMERA)
    for i in range(count):
        record, packet = record_at(records, i), advance(packets, (i >> 4) * PACKET_WORDS)
        ray = sight_ray(camera, f64_at(record, X), f64_at(record, Y), 0.5, 0.5, 0.5)
        vec3_put(record, ORIGIN, ray.origin)
        vec3_put(record, DIRECTION, ray.direction)
        put_lane(packet, PACKET_ORIGIN, i & 15, ray.origin)
        put_lane(packet, PACKET_DIRECTION, i & 15, ray.direction)


@kernel
def along(camera: Table, axis: i64, x: F64x16, y: F64x16) -> F64x16:
    """One component of the directions of a pinhole's rays, not yet of unit length."""
    corner, right = splat16d(f64_at(camera, _CORNER + axis)), splat16d(f64_at(camera, _RIGHT + axis))
    return corner + right * x + splat16d(f64_at(camera, _DOWN + axis)) * y


@kernel(exact=True)
def length_of(x: F64x16, y: F64x16, z: F64x16) -> F64x16:
    """The lengths of vectors, as `vec.length` computes one."""
    return sqrt16d(product16d(x, x) + product16d(y, y) + product16d(z, z))


@kernel
def generate_sixteen(frame: Table, records: Table, first: i64, packet: Table) -> None:
    """The rays of 4 x 4 pixels of a pinhole camera, from record number `first` on."""
    camera, lattice, corner = table_at(frame, CAMERA), table_at(frame, LATTICE), record_at(records, first)
    x, y = splat16d(f64_at(corner, X)) + load16d(lattice, 0), splat16d(f64_at(corner, Y)) + load16d(lattice, 16)
    dx, dy, dz = along(camera, 0, x, y), along(camera, 1, x, y), along(camera, 2, x, y)
    length = length_of(dx, dy, dz)
    store16d(packet, PACKET_DIRECTION, dx / length)
    store16d(packet, PACKET_DIRECTION + 16, dy / length)
    store16d(packet, PACKET_DIRECTION + 32, dz / length)
    eye, time = vec3_at(camera, _EYE), f64_at(camera, SHUTTER_OPEN)
    time += 0.5 * (f64_at(camera, SHUTTER_CLOSE) - time)
    store16d(packet, PACKET_ORIGIN, splat16d(eye.x))
    store16d(packet, PACKET_ORIGIN + 16, splat16d(eye.y))
    store16d(packet, PACKET_ORIGIN + 32, splat16d(eye.z))
    for lane in range(16):
        record = record_at(records, first + lane)
        at = PACKET_DIRECTION + lane
        vec3_put(record, ORIGIN, Vec3(eye.x, eye.y, eye.z, time))
        vec3_put(record, DIRECTION, Vec3(f64_at(packet, at), f64_at(packet, at + 16), f64_at(packet, at + 32)))
