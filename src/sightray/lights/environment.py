"""Light from all around: a picture of the whole sky, or the same from everywhere."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import Color, color, derived_array, derived_integer, derived_vector, integer, other
from sightray.lights.area import MAX_GRID, cut, place_in_cells
from sightray.lights.base import (
    LightSample,
    LightSample8,
    cells,
    density_eight,
    direction_density,
    illuminate,
    illuminate_eight,
    sky,
    sky_eight,
)
from sightray.lights.lit import _Lit
from sightray.lights.picture import LUMINANCE, picture, pixel8_at, pixel_at, radiant_pixels
from sightray.mathlib.distribution import cell_probability, cell_probability8, cumulated, draw_cell, draw_cell8
from sightray.mathlib.eight_functions import atan2_8, circle8
from sightray.mathlib.eight_paths import grey8
from sightray.mathlib.eights import (
    F64x8,
    Vec3x8,
    dot8,
    floor8d,
    floor8i,
    gather8d,
    select8d,
    select8v,
    splat8d,
    splat8v,
    sqrt8d,
    vmax8d,
    vmin8d,
    whole8d,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.transform import Transform, as_transform
from sightray.mathlib.vec import Vec3, dot, grey
from sightray.mathlib.warp import circle

TURNED = 1e-6  # how far the axes may be from orthonormal


def _rotation(value: Any) -> Transform:
    """A map that turns and does nothing else to directions, or a `SceneError`."""
    turn = as_transform(value)
    axes = turn.matrix[:3, :3]
    if np.abs(axes.T @ axes - np.eye(3)).max() > TURNED:
        raise SceneError("the axes are not orthonormal; allowed: a rotation")
    return turn


class EnvironmentLight(_Lit):
    """Light from infinitely far away: `radiance` times a picture of all directions, or `radiance` alone.

    The picture is in the lat-long (equirectangular) projection: rows are even in the angle from +y, which is the top
    row, to -y; columns run once around. The middle column looks along -z, and columns further to the right turn to +x:
    what a camera that stands upright and looks along -z sees in front of it. With theta the angle from +y and W x H
    pixels, the direction (x, y, z) is looked up at

        column = W (1/2 + atan2(x, -z) / 2 pi),  row = H theta / pi,

    between the centres of the four nearest pixels. `transform` turns it: ``Transform.rotate((0, 1, 0), 90)`` moves the
    middle from -z to -x. A translation has no effect.

    Directions are chosen in proportion to luminance times solid angle, pixel by pixel. A pixel's luminance is the mean
    over its area of what the lookup between pixels gives, which is (1, 6, 1)/8 of it and its neighbours along either
    axis, so that no light is left out. The picture takes 21 bytes a pixel. `grid` cells divide the picture's light,
    not its area. Where a `spectrum` is stated, all of the picture has it: its pixels count by their luminance.

    Reference: M. Pharr, W. Jakob, G. Humphreys, Physically Based Rendering, 4th ed. 2023, section 12.5.
    """

    image: Any = picture(default=None)
    radiance: Color = color("radiance of the sky, or what the picture is multiplied by", default=1.0, unit="W/(m² sr)")
    transform: Transform = other("a rotation, world from picture", _rotation, default=None,
                                 plain=lambda t: None if t.is_identity else t.matrix.tolist())  # fmt: skip
    grid: int = integer("grid x grid shadow rays", default=4, at_least=1, at_most=MAX_GRID)
    _x: Any = derived_vector("world x of the picture's axes", lambda e: e.transform.matrix[0, :3])
    _y: Any = derived_vector("world y of the picture's axes", lambda e: e.transform.matrix[1, :3])
    _z: Any = derived_vector("world z of the picture's axes", lambda e: e.transform.matrix[2, :3])
    _width: Any = derived_integer("columns", lambda e: e.pixels.shape[1])
    _height: Any = derived_integer("rows", lambda e: e.pixels.shape[0])
    _pixels: Any = derived_array("colours, three floats each", lambda e: e.pixels)
    _edges: Any = derived_array("cosines of the angles from +y of the rows' edges, height + 1", lambda e: e.edges())
    _sums: Any = derived_array("cumulated weights of the pixels", lambda e: cumulated(e.weights()))
    _shown: Any = derived_vector("radiance in RGB", lambda light: light.shown())

    @property
    def infinite(self) -> bool:
        return True

    @property
    def pixels(self) -> np.ndarray:
        """The picture, (h, w, 3) float32, linear, read-only; one white pixel if there is none."""
        return self.__dict__["_picture"]

    def edges(self) -> np.ndarray:
        """Cosines of the angles from +y where rows begin and the last one ends, (h + 1,) float64."""
        return np.cos(np.linspace(0.0, math.pi, len(self.pixels) + 1))

    def check(self) -> None:
        """Read the file once, so that a missing one is an error where the light is stated."""
        white = np.ones((1, 1, 3), np.float32)
        found = white if self.image is None else radiant_pixels(self.image, "EnvironmentLight")
        if self.spectrum is not None and self.image is not None:  # of the picture, its brightness counts
            found = np.repeat((found.astype(np.float64) @ LUMINANCE)[..., None], 3, axis=2).astype(np.float32)
            found.flags.writeable = False
        object.__setattr__(self, "_picture", found)

    def weights(self) -> np.ndarray:
        """What the pixels weigh among each other: mean luminance times solid angle, (h, w) float64."""
        bright = self.pixels.astype(np.float64) @ LUMINANCE
        bright = 0.75 * bright + 0.125 * (np.roll(bright, 1, axis=1) + np.roll(bright, -1, axis=1))
        above, below = np.vstack([bright[:1], bright[:-1]]), np.vstack([bright[1:], bright[-1:]])
        bright = 0.75 * bright + 0.125 * (above + below)
        return bright * -np.diff(self.edges())[:, None]


_, GRID, X, Y, Z, WIDTH, HEIGHT, PIXELS, EDGES, SUMS, RADIANCE = EnvironmentLight.offsets()[1:]


@implements(cells, EnvironmentLight)
def cells_of_environment(light: Table) -> i64:
    return i64_at(light, GRID) * i64_at(light, GRID)


@kernel
def into_picture(light: Table, d: Vec3) -> Vec3:
    """A world direction in the axes of the picture."""
    return vec3_at(light, X) * d.x + vec3_at(light, Y) * d.y + vec3_at(light, Z) * d.z


@kernel
def out_of_picture(light: Table, d: Vec3) -> Vec3:
    """A direction in the axes of the picture, in the world."""
    return Vec3(dot(vec3_at(light, X), d), dot(vec3_at(light, Y), d), dot(vec3_at(light, Z), d))


@kernel
def column_of(d: Vec3, w: i64) -> f64:
    """Where a direction stands along a row, 0 to w."""
    return w * (0.5 + math.atan2(d.x, -d.z) / (2.0 * math.pi))


@kernel
def row_of(d: Vec3, h: i64) -> f64:
    """Where a direction stands along a column, 0 to h."""
    return h * math.atan2(math.sqrt(d.x * d.x + d.z * d.z), d.y) / math.pi


@kernel
def solid_angle_of(row: i64, w: i64, h: i64) -> f64:
    """Solid angle of a pixel."""
    return 2.0 * math.pi / w * (math.cos(math.pi * row / h) - math.cos(math.pi * (row + 1) / h))


@kernel
def looked_up(light: Table, d: Vec3) -> Vec3:
    """Radiance that comes from a direction of the picture."""
    w, h = i64_at(light, WIDTH), i64_at(light, HEIGHT)
    if w * h == 1:
        return vec3_at(light, RADIANCE) * pixel_at(table_at(light, PIXELS), 1, 0, 0)
    return between_pixels(light, column_of(d, w), row_of(d, h))


@kernel
def between_pixels(light: Table, along: f64, down: f64) -> Vec3:
    """Radiance from a place in the picture, 0 to w along a row and 0 to h down a column."""
    w, h = i64_at(light, WIDTH), i64_at(light, HEIGHT)
    x, y = along - 0.5, down - 0.5
    left, top = math.floor(x), math.floor(y)
    s, t = x - left, y - top
    column, row = w - 1 if left < 0.0 else int(left), min(max(int(top), 0), h - 1)
    following, below = 0 if column + 1 == w else column + 1, min(max(int(top) + 1, 0), h - 1)
    pixels = table_at(light, PIXELS)
    upper = pixel_at(pixels, w, column, row) * (1.0 - s) + pixel_at(pixels, w, following, row) * s
    lower = pixel_at(pixels, w, column, below) * (1.0 - s) + pixel_at(pixels, w, following, below) * s
    return vec3_at(light, RADIANCE) * (upper * (1.0 - t) + lower * t)


@implements(sky, EnvironmentLight)
def sky_of_environment(light: Table, d: Vec3) -> Vec3:
    return looked_up(light, into_picture(light, d))


@implements(illuminate, EnvironmentLight)
def illuminate_from_environment(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    # Draw a pixel, and a direction in it that is even in solid angle.
    w, h, n = i64_at(light, WIDTH), i64_at(light, HEIGHT), cut(i64_at(light, GRID), cell)
    place = place_in_cells(n, cell, u, v)
    drawn = draw_cell(table_at(light, SUMS), w, h, place.x, place.y)
    edges = table_at(light, EDGES)
    upper, lower = f64_at(edges, drawn.row), f64_at(edges, drawn.row + 1)
    cosine = upper + (lower - upper) * drawn.v
    sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
    column = drawn.column + drawn.u
    around = circle(column / w - 0.5)
    d = Vec3(sine * around.y, cosine, -sine * around.x)
    if not drawn.probability > 0.0:
        return LightSample(out_of_picture(light, d), math.inf, grey(0.0), 0.0)
    density = drawn.probability / (2.0 * math.pi / w * (upper - lower))
    radiance = between_pixels(light, column, row_of(d, h))
    return LightSample(out_of_picture(light, d), math.inf, radiance * (1.0 / (density * (n * n))), density)


@implements(direction_density, EnvironmentLight)
def density_of_environment(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    if i64_at(light, WIDTH) * i64_at(light, HEIGHT) == 1:
        return 0.25 / math.pi
    d = into_picture(light, l)
    w, h = i64_at(light, WIDTH), i64_at(light, HEIGHT)
    row, column = min(int(row_of(d, h)), h - 1), min(int(column_of(d, w)), w - 1)
    edges = table_at(light, EDGES)
    solid_angle = 2.0 * math.pi / w * (f64_at(edges, row) - f64_at(edges, row + 1))
    return cell_probability(table_at(light, SUMS), w, h, row, column) / solid_angle


# ---------------------------------------------------------------------------------------------------- for eight paths


@kernel
def into_picture8(light: Table, d: Vec3x8) -> Vec3x8:
    """`into_picture` for eight directions."""
    return splat8v(vec3_at(light, X)) * d.x + splat8v(vec3_at(light, Y)) * d.y + splat8v(vec3_at(light, Z)) * d.z


@kernel
def out_of_picture8(light: Table, d: Vec3x8) -> Vec3x8:
    """`out_of_picture` for eight directions."""
    x, y, z = splat8v(vec3_at(light, X)), splat8v(vec3_at(light, Y)), splat8v(vec3_at(light, Z))
    return Vec3x8(dot8(x, d), dot8(y, d), dot8(z, d))


@kernel
def column8_of(d: Vec3x8, w: i64) -> F64x8:
    """`column_of` for eight directions."""
    return w * (0.5 + atan2_8(d.x, -d.z) * (0.5 / math.pi))


@kernel
def row8_of(d: Vec3x8, h: i64) -> F64x8:
    """`row_of` for eight directions."""
    return atan2_8(sqrt8d(d.x * d.x + d.z * d.z), d.y) * (h / math.pi)


@kernel
def between_pixels8(light: Table, along: F64x8, down: F64x8) -> Vec3x8:
    """`between_pixels` for eight places."""
    w, h, pixels = i64_at(light, WIDTH), i64_at(light, HEIGHT), table_at(light, PIXELS)
    x, y, zero, last = along - 0.5, down - 0.5, splat8d(0.0), splat8d(h - 1.0)
    left, top = floor8d(x), floor8d(y)
    s, t = x - left, y - top
    left = vmin8d(select8d(left < 0.0, splat8d(w - 1.0), left), splat8d(w - 1.0))  # also where there is no direction
    right = select8d(left + 1.0 >= float(w), zero, left + 1.0)
    column, following = floor8i(left), floor8i(right)
    row, below = floor8i(vmin8d(vmax8d(top, zero), last)), floor8i(vmin8d(vmax8d(top + 1.0, zero), last))
    upper = pixel8_at(pixels, w, column, row) * (1.0 - s) + pixel8_at(pixels, w, following, row) * s
    lower = pixel8_at(pixels, w, column, below) * (1.0 - s) + pixel8_at(pixels, w, following, below) * s
    return splat8v(vec3_at(light, RADIANCE)) * (upper * (1.0 - t) + lower * t)


@implements(sky_eight, EnvironmentLight)
def sky_of_environment_eight(light: Table, d: Vec3x8) -> Vec3x8:
    w, h = i64_at(light, WIDTH), i64_at(light, HEIGHT)
    if w * h == 1:
        return splat8v(vec3_at(light, RADIANCE) * pixel_at(table_at(light, PIXELS), 1, 0, 0))
    found = into_picture8(light, d)
    return between_pixels8(light, column8_of(found, w), row8_of(found, h))


@implements(illuminate_eight, EnvironmentLight)
def illuminate_eight_from_environment(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    w, h, edges = i64_at(light, WIDTH), i64_at(light, HEIGHT), table_at(light, EDGES)
    drawn = draw_cell8(table_at(light, SUMS), w, h, u, v)
    upper, lower = gather8d(edges, drawn.row), gather8d(edges, drawn.row + 1)
    cosine = upper + (lower - upper) * drawn.v
    sine = sqrt8d(vmax8d(splat8d(0.0), 1.0 - cosine * cosine))
    column = whole8d(drawn.column) + drawn.u
    x, y = circle8(column * (1.0 / w) - 0.5)
    d = Vec3x8(sine * y, cosine, -(sine * x))
    density = drawn.probability / ((upper - lower) * (2.0 * math.pi / w))
    light_of = sky_between(light, column, d)
    there = drawn.probability > 0.0
    irradiance = select8v(there, light_of * (1.0 / density), grey8(0.0))
    return LightSample8(
        out_of_picture8(light, d), splat8d(math.inf), irradiance, select8d(there, density, splat8d(0.0))
    )


@kernel
def sky_between(light: Table, column: F64x8, d: Vec3x8) -> Vec3x8:
    """Radiance from directions of the picture whose columns are known."""
    w, h = i64_at(light, WIDTH), i64_at(light, HEIGHT)
    if w * h == 1:
        return splat8v(vec3_at(light, RADIANCE) * pixel_at(table_at(light, PIXELS), 1, 0, 0))
    return between_pixels8(light, column, row8_of(d, h))


@implements(density_eight, EnvironmentLight)
def density_eight_of_environment(light: Table, p: Vec3x8, l: Vec3x8, distance: F64x8) -> F64x8:  # noqa: E741
    w, h, edges = i64_at(light, WIDTH), i64_at(light, HEIGHT), table_at(light, EDGES)
    if w * h == 1:
        return splat8d(0.25 / math.pi)
    d = into_picture8(light, l)
    row = floor8i(vmin8d(row8_of(d, h), splat8d(h - 1.0)))
    column = floor8i(vmin8d(column8_of(d, w), splat8d(w - 1.0)))
    solid_angle = (gather8d(edges, row) - gather8d(edges, row + 1)) * (2.0 * math.pi / w)
    return cell_probability8(table_at(light, SUMS), w, h, row, column) * (1.0 / solid_angle)
