"""The record of a pixel: what its centre ray met, in doubles; and the row that describes the picture being labelled.

Records live for 64 pixels at a time, a tile of 8 x 8, and stay in the processor's nearest cache while all layers are
computed from them. A record is `RECORD_WORDS` words at the offsets below; vectors are in the world.
"""

from __future__ import annotations

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, advance, f64_at, f64_put, i64_at, vec3_at
from sightray.mathlib.vec import Vec3

SIDE = 8  # pixels along a tile
BLOCK = SIDE * SIDE

# Words of a record. POSITION to TEXTURE_V are only there if a layer asks for them, see `Layer.detail`.
ORIGIN, DIRECTION, POSITION, NORMAL, SHADING = 0, 4, 8, 12, 16
T, ITEM, PRIM, U, V, TEXTURE_U, TEXTURE_V = 20, 21, 22, 23, 24, 25, 26
PIXEL, X, Y = 27, 28, 29  # number of the pixel, row by row; continuous coordinates of its centre
SEEN = 30  # item and primitive in one word: the same for pixels that show the same; negative for nothing
RECORD_WORDS = 32

# Words of a frame: the picture being labelled.
WORLD, CAMERA, KINDS, CASTS, CAST_COUNT = 0, 1, 2, 3, 4
COLUMNS, ROWS, SCALE, DETAIL = 5, 6, 7, 8  # SCALE: rays along a pixel's side; COLUMNS and ROWS count rays
CLASS_OF_ITEM, MATERIAL_OF_ITEM, OBJECT_FRAMES = 9, 10, 11
NEXT, PREVIOUS, STEREO = 12, 13, 14  # rows of `view.Motion`, or null
INTEGRATOR, SAMPLER, PATH_NAMES, BOXES = 15, 32, 33, 34  # BOXES: of the items that are cast at, see `vision.picking`
LATTICE = 35  # of a pinhole whose rows share one time: steps of x and y in 4 x 4 pixels, else null
CAMERA_FROM_WORLD = 16
FRAME_WORDS = 40
OBJECT_FRAME_WORDS = 24  # of each item: object_from_world of its object, then centre and diagonal of its box

# Values of DETAIL: what is computed of a hit beside t, item and primitive. FACE: position and geometric normal.
RAY_ONLY, POINT, FACE, SURFACE = 0, 1, 2, 3
FLAT = 2  # of KINDS, beside those of `scene.crossings`: no mesh, but each primitive has one normal


@kernel
def record_at(records: Table, index: i64) -> Table:
    """Record number `index` of a tile."""
    return advance(records, index * RECORD_WORDS)


@kernel
def is_met(record: Table) -> bool:
    """Whether the pixel's ray met anything."""
    return i64_at(record, ITEM) >= 0


@kernel
def point_on_ray(record: Table) -> Vec3:
    """Where the ray met it: origin + t direction, for any detail."""
    return vec3_at(record, ORIGIN) + vec3_at(record, DIRECTION) * f64_at(record, T)


@kernel
def put_pair(out: Table, row: i64, a: f64, b: f64) -> None:
    """Write row number `row` of an (n, 2) array of doubles."""
    f64_put(out, 2 * row, a)
    f64_put(out, 2 * row + 1, b)
