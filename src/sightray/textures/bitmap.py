"""A picture on a surface."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import choice, derived_array, derived_integer, derived_vector, flag, other
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f32_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3
from sightray.textures.base import Texture, Where, texture_value
from sightray.textures.pyramid import means_over, pyramid

NEAREST, BILINEAR, TRILINEAR = 0, 1, 2
REPEAT, CLAMP, MIRROR = 0, 1, 2


def _source(value: Any) -> Any:
    """A path, or a read-only (h, w, channels) float32 array."""
    from sightray.images import Image

    if isinstance(value, str | os.PathLike):
        return Path(value)
    try:
        return (value if isinstance(value, Image) else Image(value)).pixels
    except (TypeError, ValueError) as error:  # numbers in rows of unequal length, among others
        raise SceneError(f"{error}. Or give the path of a picture") from None


def _pair(value: Any) -> tuple[float, float]:
    """Two finite numbers, or one for both."""
    numbers = np.asarray(value)
    if numbers.shape not in ((), (2,)) or numbers.dtype.kind not in "iuf" or not np.isfinite(numbers).all():
        raise SceneError(f"got {value!r}; allowed: two finite numbers, for u and v, or one for both")
    u, v = np.broadcast_to(numbers, 2).tolist()
    return float(u), float(v)


class Bitmap(Texture):
    """A picture spread over the unit square of texture coordinates: u runs to the right, v upwards.

    The picture's bottom-left corner is (u, v) = (0, 0), its top-right corner (1, 1); row 0 of the array is on top. In
    a picture of w columns, texel i stands at u = (i + 1/2)/w. ``"bilinear"`` blends the four nearest texels,
    ``"nearest"`` takes the one that covers the place. ``"trilinear"`` also averages over the footprint of the ray: it
    blends the two of a pyramid of ever smaller pictures whose texels are next larger and next smaller, so that what is
    far away does not shimmer, and is a little blurred where the surface is seen at a slant. Outside the unit square the
    picture is repeated, mirrored at each edge, or goes on with its border texels (``"clamp"``). It is looked up at
    ``scale * (u, v) + offset``.

    Alpha is ignored and grey stands for three equal channels. Texels take 12 bytes each, a pyramid a third more.

    References
    ----------
    P. Heckbert, "Survey of texture mapping", IEEE CG&A 6(11), 1986; L. Williams, "Pyramidal parametrics", SIGGRAPH 1983;
    J. Amanatides, "Ray tracing with cones", SIGGRAPH 1984.
    """

    image: Any = other("picture file, or linear floats of shape (h, w), (h, w, 1), (h, w, 3) or (h, w, 4)", _source,
                       plain=lambda image: str(image) if isinstance(image, Path) else image.tolist())  # fmt: skip
    filter: str = choice("how texels are blended", ("nearest", "bilinear", "trilinear"), default="bilinear")
    wrap: str = choice("what lies beyond the edges", ("repeat", "clamp", "mirror"), default="repeat")
    linear: bool = flag("whether a PNG or JPEG holds plain numbers; arrays are always linear", default=False)
    scale: tuple[float, float] = other("pictures per unit of u and v", _pair, default=1.0, plain=list)
    offset: tuple[float, float] = other("added to the scaled u and v", _pair, default=0.0, plain=list)
    _scale: Any = derived_vector("scale of u and v", lambda b: (*b.scale, 0.0))
    _offset: Any = derived_vector("offset of u and v", lambda b: (*b.offset, 0.0))
    _width: Any = derived_integer("columns", lambda b: b.pixels.shape[1])
    _height: Any = derived_integer("rows", lambda b: b.pixels.shape[0])
    _texels: Any = derived_array("colours, three floats each", lambda b: b.pixels)
    _levels: Any = derived_array("columns, rows and first texel of each level", lambda b: b.levels()[0])
    _count: Any = derived_integer("number of levels", lambda b: len(b.levels()[0]))
    _smaller: Any = derived_array("texels of the levels above the first", lambda b: b.levels()[1])

    @property
    def pixels(self) -> np.ndarray:
        """The texels as the kernels see them: (h, w, 3) float32, linear, read-only."""
        return self.__dict__["_pixels"]

    def levels(self) -> tuple[np.ndarray, np.ndarray]:
        """The pyramid of the picture, made once; of its first level alone unless it is asked for."""
        if "_pyramid" not in self.__dict__:
            object.__setattr__(self, "_pyramid", pyramid(self.pixels, None if self.filter == "trilinear" else 1))
        return self.__dict__["_pyramid"]

    def brightness(self) -> float:
        return float(self.pixels.mean())

    def brightness_over(self, corners: np.ndarray) -> np.ndarray:
        return means_over(self.pixels.mean(axis=2, keepdims=True), corners * self.scale + self.offset, self.wrap)

    def as_numbers(self) -> Bitmap:
        return self.replace(linear=True) if isinstance(self.image, Path) and not self.linear else self

    def check(self) -> None:
        """Read the file once, so that a missing one is an error where the texture is stated."""
        from sightray.images import load_image

        where = self.image if isinstance(self.image, Path) else "the array"
        found = load_image(where, linear=self.linear).pixels if isinstance(self.image, Path) else self.image
        if not np.isfinite(found[..., :3]).all():
            raise SceneError(f"Bitmap.image: {where} holds infinite or undefined numbers; allowed: finite ones")
        texels = np.ascontiguousarray(np.broadcast_to(found[..., :3], (*found.shape[:2], 3)))
        texels.flags.writeable = False
        object.__setattr__(self, "_pixels", texels)


FILTER, WRAP, _, SCALE, OFFSET, WIDTH, HEIGHT, TEXELS, LEVELS, COUNT, SMALLER = Bitmap.offsets()


@kernel
def wrapped(i: f64, n: i64, wrap: i64) -> i64:
    """Whole number i brought into 0 ... n - 1; it comes as a double, because far away it would overflow an integer."""
    if wrap == REPEAT:
        i -= n * np.floor(i / n)
    elif wrap == MIRROR:
        i -= 2 * n * np.floor(i / (2 * n))
        if i >= n:
            i = 2 * n - 1 - i
    if not i > 0.0:  # so written that NaN becomes 0
        return 0
    return n - 1 if i >= n else int(i)


@kernel
def texel(texture: Table, level: i64, column: f64, row: f64) -> Vec3:
    """Colour of a texel; rows count from the bottom."""
    sizes, wrap = table_at(texture, LEVELS), i64_at(texture, WRAP)
    w, h = i64_at(sizes, 3 * level), i64_at(sizes, 3 * level + 1)
    at = 3 * (i64_at(sizes, 3 * level + 2) + (h - 1 - wrapped(row, h, wrap)) * w + wrapped(column, w, wrap))
    texels = table_at(texture, TEXELS if level == 0 else SMALLER)
    return Vec3(float(f32_at(texels, at)), float(f32_at(texels, at + 1)), float(f32_at(texels, at + 2)), 0.0)


@kernel
def bilinear(texture: Table, level: i64, u: f64, v: f64) -> Vec3:
    """Blend the texels whose centres surround the place."""
    sizes = table_at(texture, LEVELS)
    x, y = u * i64_at(sizes, 3 * level) - 0.5, v * i64_at(sizes, 3 * level + 1) - 0.5
    column, row = np.floor(x), np.floor(y)
    s, t = x - column, y - row
    low = texel(texture, level, column, row) * (1.0 - s) + texel(texture, level, column + 1.0, row) * s
    high = texel(texture, level, column, row + 1.0) * (1.0 - s) + texel(texture, level, column + 1.0, row + 1.0) * s
    return low * (1.0 - t) + high * t


@implements(texture_value, Bitmap)
def value_of_bitmap(texture: Table, where: Where) -> Vec3:
    scale, offset = vec3_at(texture, SCALE), vec3_at(texture, OFFSET)
    u, v = where.u * scale.x + offset.x, where.v * scale.y + offset.y
    filtering = i64_at(texture, FILTER)
    if filtering == NEAREST:
        return texel(texture, 0, np.floor(u * i64_at(texture, WIDTH)), np.floor(v * i64_at(texture, HEIGHT)))

    # The level on which a texel is as wide as the footprint lies between two; blend them.
    footprint = where.width * abs(scale.x) * i64_at(texture, WIDTH)
    if filtering == BILINEAR or not footprint > 1.0:
        return bilinear(texture, 0, u, v)
    top = i64_at(texture, COUNT) - 1
    level = min(math.log2(footprint), float(top))
    below = min(int(level), max(top - 1, 0))
    s = level - below
    if s == 0.0:
        return bilinear(texture, below, u, v)
    return bilinear(texture, below, u, v) * (1.0 - s) + bilinear(texture, below + 1, u, v) * s
