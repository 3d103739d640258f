"""A clear or hazy day: the sun's disc, and the blue that its light makes of the air."""

from __future__ import annotations

import datetime
import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.errors import SceneError
from sightray.fields import (
    Color,
    Point,
    color,
    derived_array,
    derived_number,
    derived_vector,
    integer,
    number,
    text,
    vector,
)
from sightray.lights.area import MAX_GRID, cut, place_in_cells
from sightray.lights.base import (
    Light,
    LightSample,
    LightSample8,
    cells,
    density_eight,
    direction_density,
    illuminate,
    illuminate_eight,
    in_lanes,
    sky,
    sky_eight,
)
from sightray.lights.daylight import (
    SUN_RADIUS,
    Perez,
    daylight_rows,
    preetham,
    rgb_of_luminance,
    sky_brightness,
    sun_brightness,
)
from sightray.lights.daylight import sun_direction as sun_at
from sightray.lights.environment import column8_of, column_of, row8_of, row_of, solid_angle_of
from sightray.lights.picture import LUMINANCE
from sightray.lights.sphere import in_cone, in_cone8
from sightray.materials.by_wavelength import at_bands
from sightray.mathlib.axes import unit
from sightray.mathlib.distribution import (
    BELOW_ONE,
    cell_probability,
    cell_probability8,
    cumulated,
    draw_cell,
    draw_cell8,
)
from sightray.mathlib.eight_functions import atan2_8, circle8, exp8
from sightray.mathlib.eight_paths import grey8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    dot8,
    floor8i,
    not8,
    select8d,
    select8v,
    splat8d,
    splat8v,
    sqrt8d,
    vmax8d,
    vmin8d,
    whole8d,
)
from sightray.mathlib.lanes import Mask8, movemask8
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, dot, grey, vexp, vmax
from sightray.mathlib.warp import circle

W, H, FINE = 128, 64, 4  # cells of the table that directions are drawn from, and places in each, along a side
LEAST, MOST = 0.1, 0.9  # share of samples that go to the sun, if there are both


class SunSky(Light):
    """Sun and sky after A. Preetham: what comes from above on a day without clouds, and a ground that reflects it.

    The sky's luminance and chromaticity follow Perez's formula with the coefficients that A. Preetham fitted to
    simulations, for `turbidity` from 2 (clear) over 4 (usual in summer) to 10 (hazy). The sun is a disc of its true
    size, evenly bright, as hot as the sun's surface, reddened and dimmed by the air. Another `sun_radius` keeps what
    it brings, for softer or harder shadows. Below the horizon a matte `ground` is lit by both.

    The sun stands in `direction`, or where it was at a `time` at a `latitude` and `longitude`; then +x is east and -z
    north. +y is up.

    Spectral paths see the colour of sun or sky as the mixture of the CIE's three components of daylight, cut off at 0.

    Radiance is in W/(m² sr) of visible light: luminance over 184 lm/W, the efficacy of D65. A sunny noon brings about
    500 W/m² to the ground, so white paper has a radiance of 150; a `scale` of 0.005 to 0.01 suits pictures without
    exposure.

    Reference: A. Preetham, P. Shirley, B. Smits, "A practical analytic model for daylight", SIGGRAPH 1999.
    """

    direction: Point = vector("towards the sun", default=(0.4, 0.6, 0.3), nonzero=True)
    time: str = text("date and time, such as 2024-06-21T15:30+02:00; universal time if no zone is stated. Empty: "
                     "`direction` counts", default="")  # fmt: skip
    latitude: float = number("of the place, north", default=0.0, at_least=-90, at_most=90, unit="degrees")
    longitude: float = number("of the place, east", default=0.0, at_least=-180, at_most=180, unit="degrees")
    turbidity: float = number("haze: all that dims sunlight over what air alone would", default=3.0, at_least=2,
                              at_most=10)  # fmt: skip
    scale: Color = color("what all radiance is multiplied by", default=1.0)
    sun_scale: float = number("what the sun's radiance is multiplied by", default=1.0, at_least=0)
    sky_scale: float = number("what the sky's radiance is multiplied by", default=1.0, at_least=0)
    sun_radius: float = number("angular radius of the sun", default=SUN_RADIUS, at_least=0.01, at_most=10,
                               unit="degrees")  # fmt: skip
    ground: Color = color("albedo of the ground below the horizon", default=0.2, at_most=1.0)
    grid: int = integer("grid x grid shadow rays", default=4, at_least=1, at_most=MAX_GRID)
    _to_sun: Any = derived_vector("unit vector towards the sun", lambda s: s.to_sun())
    _cap: Any = derived_number("1 - cos of the sun's radius", lambda s: s.cap())
    _sun_share: Any = derived_number("share of samples that go to the sun", lambda s: s.sun_share())
    _sun: Any = derived_vector("radiance of the sun's disc", lambda s: s.sun_radiance())
    _below: Any = derived_vector("radiance of the ground", lambda s: s.ground_radiance())
    _a: Any = derived_vector("Perez's coefficients, for luminance and chromaticities", lambda s: s.perez().a)
    _b: Any = derived_vector("the second", lambda s: s.perez().b)
    _c: Any = derived_vector("the third", lambda s: s.perez().c)
    _d: Any = derived_vector("the fourth", lambda s: s.perez().d)
    _e: Any = derived_vector("the fifth", lambda s: s.perez().e)
    _zenith: Any = derived_vector("values at the zenith over the formula's", lambda s: s.perez().zenith)
    _red: Any = derived_vector("red from XYZ", lambda s: s.matrix()[0])
    _green: Any = derived_vector("green from XYZ", lambda s: s.matrix()[1])
    _blue: Any = derived_vector("blue from XYZ", lambda s: s.matrix()[2])
    _sums: Any = derived_array("cumulated weights of the cells", lambda s: cumulated(s.weights()))
    _daylight: Any = derived_array("daylight that is red, green and blue, by wavelength", lambda s: daylight_rows())

    def check(self) -> None:
        if self.time:
            self.moment()
        if not self.to_sun()[1] > 0.0:
            where = f"at {self.time}" if self.time else f"in direction {self.direction}"
            raise SceneError(f"SunSky: the sun {where} is below the horizon; allowed: above it, +y is up")

    @property
    def infinite(self) -> bool:
        return True

    def moment(self) -> datetime.datetime:
        """The `time` as it counts."""
        try:
            return datetime.datetime.fromisoformat(self.time.replace("Z", "+00:00"))
        except ValueError:
            raise SceneError(f"SunSky.time: got {self.time!r}; allowed: as 2024-06-21T15:30+02:00") from None

    def to_sun(self) -> np.ndarray:
        """Unit vector towards the sun, (3,) float64."""
        return sun_at(self.moment(), self.latitude, self.longitude) if self.time else unit(self.direction)

    def theta(self) -> float:
        """Angle of the sun from the zenith, radians."""
        return math.acos(min(1.0, float(self.to_sun()[1])))

    def cap(self) -> float:
        """1 - cos of the sun's radius."""
        return 2.0 * math.sin(math.radians(self.sun_radius) / 2.0) ** 2

    def perez(self) -> Perez:
        """The sky's distribution."""
        return preetham(self.turbidity, self.theta())

    def matrix(self) -> np.ndarray:
        """From XYZ, in kcd/m², to radiance: (3, 3)."""
        return rgb_of_luminance() * np.array(self.scale)[:, None] * self.sky_scale

    def disc(self) -> np.ndarray:
        """Radiance of the sun's disc before `scale`, (3,)."""
        true_cap = 2.0 * math.sin(math.radians(SUN_RADIUS) / 2.0) ** 2
        return sun_brightness(self.turbidity, self.theta()) * (self.sun_scale * true_cap / self.cap())

    def sun_radiance(self) -> np.ndarray:
        """Radiance of the sun's disc, (3,)."""
        return self.disc() * self.scale

    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean of the sky over the cells of its upper half, (H/2, W, 3), before `scale`; solid angles, (H/2, 1)."""
        theta = (np.arange(H // 2 * FINE) + 0.5) * (math.pi / (H * FINE))
        phi = ((np.arange(W * FINE) + 0.5) / (W * FINE) - 0.5) * 2.0 * math.pi
        sine, cosine = np.sin(theta)[:, None], np.cos(theta)[:, None]
        d = np.stack(np.broadcast_arrays(sine * np.sin(phi), cosine, -sine * np.cos(phi)), axis=-1)
        bright = sky_brightness(self.perez(), self.to_sun(), d) * self.sky_scale
        edges = np.cos(np.linspace(0.0, 0.5 * math.pi, H // 2 + 1))
        mean = bright.reshape(H // 2, FINE, W, FINE, 3).mean(axis=(1, 3))
        return mean, ((edges[:-1] - edges[1:]) * (2.0 * math.pi / W))[:, None]

    def ground_irradiance(self) -> tuple[np.ndarray, np.ndarray]:
        """What a level ground gets from the sun and from the sky, (3,) each, W/m², before `scale`."""
        bright, solid_angle = self.table()
        height = np.cos((np.arange(H // 2) + 0.5) * (math.pi / H))[:, None, None]
        from_sky = (bright * height * solid_angle[..., None]).sum(axis=(0, 1))
        return self.disc() * (2.0 * math.pi * self.cap() * self.to_sun()[1]), from_sky

    def ground_radiance(self) -> np.ndarray:
        """What the ground gives back, (3,)."""
        return np.sum(self.ground_irradiance(), axis=0) * self.ground / math.pi * self.scale

    def sun_share(self) -> float:
        """Share of samples that go to the sun."""
        sun, sky = (float(part @ LUMINANCE) for part in self.ground_irradiance())
        if sun == 0.0 or sky == 0.0:
            return float(sun > 0.0)
        return min(max(sun / (sun + sky), LEAST), MOST)

    def weights(self) -> np.ndarray:
        """What the cells of sky and ground weigh among each other, (H, W)."""
        bright, solid_angle = self.table()
        below = np.broadcast_to(self.replace(scale=1.0).ground_radiance(), bright.shape)
        return np.concatenate([bright @ LUMINANCE * solid_angle, below @ LUMINANCE * solid_angle[::-1]])


(
    GRID, TO_SUN, CAP, SUN_SHARE, SUN, BELOW, A, B, C, D, E, ZENITH, RED, GREEN, BLUE, SUMS, DAYLIGHT,
) = SunSky.offsets()[9:]  # fmt: skip


@implements(cells, SunSky)
def cells_of_sun_and_sky(light: Table) -> i64:
    return i64_at(light, GRID) * i64_at(light, GRID)


@kernel
def radiance_from(light: Table, d: Vec3) -> Vec3:
    """Radiance of the sky in a direction, without the sun's disc; of the ground below the horizon."""
    if not d.y > 0.0:
        return vec3_at(light, BELOW)
    cosine = min(1.0, max(-1.0, dot(d, vec3_at(light, TO_SUN))))
    gamma = math.acos(cosine)
    around_zenith = 1.0 + vec3_at(light, A) * vexp(vec3_at(light, B) / d.y)
    around_sun = 1.0 + vec3_at(light, C) * vexp(vec3_at(light, D) * gamma) + vec3_at(light, E) * (cosine * cosine)
    q = vec3_at(light, ZENITH) * around_zenith * around_sun  # luminance, x, y
    xyz = Vec3(q.y / q.z * q.x, q.x, (1.0 - q.y - q.z) / q.z * q.x)
    rgb = Vec3(dot(vec3_at(light, RED), xyz), dot(vec3_at(light, GREEN), xyz), dot(vec3_at(light, BLUE), xyz))
    return vmax(rgb, grey(0.0))


@kernel
def in_sun(light: Table, d: Vec3) -> bool:
    """Whether a direction ends in the sun's disc."""
    return 1.0 - dot(d, vec3_at(light, TO_SUN)) < f64_at(light, CAP)


@implements(sky, SunSky)
def sky_of_sun_and_sky(light: Table, d: Vec3) -> Vec3:
    rest = radiance_from(light, d)
    return rest + vec3_at(light, SUN) if in_sun(light, d) else rest


@implements(in_lanes, SunSky)
def daylight_in_lanes(light: Table, bands: Table, rgb: Vec3) -> Vec3:
    rows = table_at(light, DAYLIGHT)
    mixed = (
        at_bands(rows, 3, 0, bands) * rgb.x + at_bands(rows, 3, 1, bands) * rgb.y + at_bands(rows, 3, 2, bands) * rgb.z
    )
    return vmax(mixed, grey(0.0))


@implements(direction_density, SunSky)
def density_of_sun_and_sky(light: Table, p: Vec3, l: Vec3, distance: f64) -> f64:  # noqa: E741
    share = f64_at(light, SUN_SHARE)
    row, column = min(int(row_of(l, H)), H - 1), min(int(column_of(l, W)), W - 1)
    density = (1.0 - share) * cell_probability(table_at(light, SUMS), W, H, row, column) / solid_angle_of(row, W, H)
    if in_sun(light, l):
        density += share / (2.0 * math.pi * f64_at(light, CAP))
    return density


@implements(illuminate, SunSky)
def illuminate_from_sun_and_sky(light: Table, p: Vec3, cell: i64, u: f64, v: f64) -> LightSample:
    n = cut(i64_at(light, GRID), cell)
    place = place_in_cells(n, cell, u, v)
    share = f64_at(light, SUN_SHARE)
    if place.x < share:
        d = in_cone(vec3_at(light, TO_SUN), f64_at(light, CAP), place.x / share, place.y)
    else:
        drawn = draw_cell(table_at(light, SUMS), W, H, (place.x - share) / (1.0 - share), place.y)
        upper, lower = math.cos(math.pi * drawn.row / H), math.cos(math.pi * (drawn.row + 1) / H)
        cosine = upper + (lower - upper) * drawn.v
        sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
        around = circle((drawn.column + drawn.u) / W - 0.5)
        d = Vec3(sine * around.y, cosine, -sine * around.x)
    density = density_of_sun_and_sky(light, p, d, math.inf)
    if not density > 0.0:
        return LightSample(d, math.inf, grey(0.0), 0.0)
    return LightSample(d, math.inf, sky_of_sun_and_sky(light, d) / (density * (n * n)), density)


# ---------------------------------------------------------------------------------------------------- for eight paths


@kernel
def radiance8_from(light: Table, d: Vec3x8) -> Vec3x8:
    """`radiance_from` for eight directions."""
    above, zero = d.y > 0.0, splat8d(0.0)
    below = splat8v(vec3_at(light, BELOW))
    if movemask8(above) == 0:
        return below
    cosine = vmin8d(splat8d(1.0), vmax8d(splat8d(-1.0), dot8(d, splat8v(vec3_at(light, TO_SUN)))))
    gamma = atan2_8(sqrt8d((1.0 - cosine) * (1.0 + cosine)), cosine)
    a, b, c = vec3_at(light, A), vec3_at(light, B), vec3_at(light, C)
    e, f, zenith = vec3_at(light, D), vec3_at(light, E), vec3_at(light, ZENITH)
    flat, cos2 = 1.0 / d.y, cosine * cosine
    luminance = perez8(zenith.x, a.x, b.x, c.x, e.x, f.x, flat, gamma, cos2)
    x = perez8(zenith.y, a.y, b.y, c.y, e.y, f.y, flat, gamma, cos2)
    y = perez8(zenith.z, a.z, b.z, c.z, e.z, f.z, flat, gamma, cos2)
    xyz = Vec3x8(x / y * luminance, luminance, (1.0 - x - y) / y * luminance)
    red, green, blue = splat8v(vec3_at(light, RED)), splat8v(vec3_at(light, GREEN)), splat8v(vec3_at(light, BLUE))
    rgb = Vec3x8(vmax8d(dot8(red, xyz), zero), vmax8d(dot8(green, xyz), zero), vmax8d(dot8(blue, xyz), zero))
    return select8v(above, rgb, below)


@kernel
def perez8(
    zenith: f64, a: f64, b: f64, c: f64, d: f64, e: f64, flat: F64x8, gamma: F64x8, cos2: F64x8
) -> F64x8:  # fmt: skip
    """Perez's formula, at an angle from the sun; `flat` is 1 over the cosine of the angle from the zenith."""
    return zenith * (1.0 + a * exp8(b * flat)) * (1.0 + c * exp8(d * gamma) + e * cos2)


@kernel
def in_sun8(light: Table, d: Vec3x8) -> Mask8:
    """`in_sun` for eight directions."""
    return 1.0 - dot8(d, splat8v(vec3_at(light, TO_SUN))) < f64_at(light, CAP)


@implements(sky_eight, SunSky)
def sky_of_sun_and_sky_eight(light: Table, d: Vec3x8) -> Vec3x8:
    rest = radiance8_from(light, d)
    return select8v(in_sun8(light, d), rest + splat8v(vec3_at(light, SUN)), rest)


@kernel
def edges8(row: I64x8) -> tuple[F64x8, F64x8]:
    """Cosines of the angles from +y of the upper and lower edges of rows."""
    upper, _ = circle8(whole8d(row) * (0.5 / H))
    lower, _ = circle8(whole8d(row + 1) * (0.5 / H))
    return upper, lower


@implements(density_eight, SunSky)
def density_eight_of_sun_and_sky(light: Table, p: Vec3x8, l: Vec3x8, distance: F64x8) -> F64x8:  # noqa: E741
    share = f64_at(light, SUN_SHARE)
    row = floor8i(vmin8d(row8_of(l, H), splat8d(H - 1.0)))
    column = floor8i(vmin8d(column8_of(l, W), splat8d(W - 1.0)))
    upper, lower = edges8(row)
    chance = cell_probability8(table_at(light, SUMS), W, H, row, column)
    density = chance * (1.0 - share) / ((upper - lower) * (2.0 * math.pi / W))
    in_disc = density + share / (2.0 * math.pi * f64_at(light, CAP))
    return select8d(in_sun8(light, l), in_disc, density)


@implements(illuminate_eight, SunSky)
def illuminate_eight_from_sun_and_sky(light: Table, p: Vec3x8, u: F64x8, v: F64x8) -> LightSample8:
    share, d = f64_at(light, SUN_SHARE), grey8(0.0)
    to_sun = u < share
    if movemask8(to_sun) != 0:
        axis, cap = splat8v(vec3_at(light, TO_SUN)), splat8d(f64_at(light, CAP))
        d = in_cone8(axis, cap, u * (1.0 / share), v)
    if movemask8(not8(to_sun)) != 0:
        rest = vmin8d((u - share) / splat8d(1.0 - share), splat8d(BELOW_ONE))
        drawn = draw_cell8(table_at(light, SUMS), W, H, rest, v)
        upper, lower = edges8(drawn.row)
        cosine = upper + (lower - upper) * drawn.v
        sine = sqrt8d(vmax8d(splat8d(0.0), 1.0 - cosine * cosine))
        x, y = circle8((whole8d(drawn.column) + drawn.u) * (1.0 / W) - 0.5)
        d = select8v(to_sun, d, Vec3x8(sine * y, cosine, -(sine * x)))
    density = density_eight_of_sun_and_sky(light, p, d, splat8d(math.inf))
    irradiance = sky_of_sun_and_sky_eight(light, d) * (1.0 / density)
    return LightSample8(d, splat8d(math.inf), select8v(density > 0.0, irradiance, grey8(0.0)), density)
