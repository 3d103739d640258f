"""Where the sun stands, and how bright sun and sky are: formulas for `SunSky`, in NumPy.

Brightness is linear Rec. 709 whose luminance, in cd/m², was divided by `EFFICACY`. So it reads as W/(m² sr) of visible
light with the spectrum of D65, and an illuminance in lux becomes an irradiance in W/m² likewise.
"""

from __future__ import annotations

import datetime
import math
from typing import NamedTuple

import numpy as np

from sightray.spectra import WAVELENGTHS, rgb_from_xyz, white, xyz_bar
from sightray.spectra.observer import rgb_bar
from sightray.spectra.tables import rows_of

SUN_KELVIN = 5772.0  # effective temperature of the sun (IAU 2015)
SUN_RADIUS = 0.2665  # degrees, mean over the year
LUX_PER_WATT = 683.002  # at 555 nm
Y_SUM = 106.856895  # sum of the observer's curve ȳ, nm
EFFICACY = LUX_PER_WATT * Y_SUM / float(white().sum())  # lm/W of D65 from 360 to 830 nm


class Perez(NamedTuple):
    """Distribution of luminance Y and chromaticities x and y over the sky: three numbers each."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    e: np.ndarray
    zenith: np.ndarray  # what is at the zenith, over the distribution's value there; Y in kcd/m²

    def at(self, cosine: np.ndarray, gamma: np.ndarray) -> np.ndarray:
        """Y, x and y, (..., 3), at a cosine from the zenith, above 0, and an angle from the sun, radians."""
        cosine, gamma = cosine[..., None], gamma[..., None]
        return self.zenith * self._distribution(cosine, gamma)

    def _distribution(self, cosine: np.ndarray, gamma: np.ndarray) -> np.ndarray:
        around_zenith = 1.0 + self.a * np.exp(self.b / cosine)
        return around_zenith * (1.0 + self.c * np.exp(self.d * gamma) + self.e * np.cos(gamma) ** 2)


def preetham(turbidity: float, theta: float) -> Perez:
    """The sky while the sun stands at an angle `theta` from the zenith, radians (A. Preetham et al. 1999, appendix)."""
    t = turbidity
    a, b, c, d, e = (
        np.array([slope * t + constant for slope, constant in of_y_x_y])
        for of_y_x_y in (
            ((0.1787, -1.4630), (-0.0193, -0.2592), (-0.0167, -0.2608)),
            ((-0.3554, 0.4275), (-0.0665, 0.0008), (-0.0950, 0.0092)),
            ((-0.0227, 5.3251), (-0.0004, 0.2125), (-0.0079, 0.2102)),
            ((0.1206, -2.5771), (-0.0641, -0.8989), (-0.0441, -1.6537)),
            ((-0.0670, 0.3703), (-0.0033, 0.0452), (-0.0109, 0.0529)),
        )
    )
    chi = (4.0 / 9.0 - t / 120.0) * (math.pi - 2.0 * theta)
    luminance = (4.0453 * t - 4.9710) * math.tan(chi) - 0.2155 * t + 2.4192
    haze, powers = np.array([t * t, t, 1.0]), np.array([theta**3, theta**2, theta, 1.0])
    x = haze @ np.array([[0.00166, -0.00375, 0.00209, 0.0],
                         [-0.02903, 0.06377, -0.03202, 0.00394],
                         [0.11693, -0.21196, 0.06052, 0.25886]]) @ powers  # fmt: skip
    y = haze @ np.array([[0.00275, -0.00610, 0.00317, 0.0],
                         [-0.04214, 0.08970, -0.04153, 0.00516],
                         [0.15346, -0.26756, 0.06670, 0.26688]]) @ powers  # fmt: skip
    relative = Perez(a, b, c, d, e, np.ones(3)).at(np.array(1.0), np.array(theta))
    return Perez(a, b, c, d, e, np.array([luminance, x, y]) / relative)


def rgb_of_luminance() -> np.ndarray:
    """Matrix, (3, 3), from XYZ with Y in kcd/m² to brightness."""
    return rgb_from_xyz() * (1000.0 / EFFICACY)


def sky_brightness(sky: Perez, sun: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Brightness of the sky, (..., 3), in unit directions, (..., 3), above the horizon; `sun` is one, too."""
    gamma = np.arccos(np.clip(directions @ sun, -1.0, 1.0))
    luminance, x, y = np.moveaxis(sky.at(directions[..., 1], gamma), -1, 0)
    xyz = np.stack([x / y, np.ones_like(x), (1.0 - x - y) / y], axis=-1) * luminance[..., None]
    return np.maximum(xyz @ rgb_of_luminance().T, 0.0)


def daylight_rows() -> np.ndarray:
    """(471, 3) at `WAVELENGTHS`: the spectra of daylight whose colours are (1, 0, 0), (0, 1, 0) and (0, 0, 1).

    Sums of them are sums of the three components by which the CIE describes all phases of daylight, so they come near to
    what sky and sun send out, and are of the colour that they stand for.

    Reference: D. Judd, D. MacAdam, G. Wyszecki, "Spectral distribution of typical daylight as a function of correlated
    color temperature", JOSA 54(8), 1964.
    """
    nm, *parts = rows_of("daylight").T
    components = np.stack([np.interp(WAVELENGTHS, nm, part) for part in parts], axis=1)
    return np.ascontiguousarray(components @ np.linalg.inv(components.T @ rgb_bar()).T)


def sun_brightness(turbidity: float, theta: float) -> np.ndarray:
    """Brightness of the sun's disc, (3,), at an angle `theta` from the zenith, radians.

    Planck's law for the sun's surface, dimmed by the molecules and the haze of the air on the way (Preetham et al.,
    after M. Iqbal, "An Introduction to Solar Radiation", 1983). What ozone and water vapour take is left out.
    """
    nm = WAVELENGTHS
    planck = 1.191042972e20 / nm**5 / np.expm1(1.438776877e7 / (nm * SUN_KELVIN))  # W/(m² sr nm)
    degrees = math.degrees(theta)
    mass = 1.0 / (math.cos(theta) + 0.15 * (93.885 - degrees) ** -1.253)
    micrometres = nm / 1000.0
    haze = 0.04608 * turbidity - 0.04586
    left = np.exp(-mass * (0.008735 * micrometres**-4.08 + haze * micrometres**-1.3))
    return np.maximum(rgb_from_xyz() @ ((planck * left) @ xyz_bar()) * (LUX_PER_WATT * Y_SUM / EFFICACY), 0.0)


def sun_direction(when: datetime.datetime, latitude: float, longitude: float) -> np.ndarray:
    """Unit vector towards the sun, (3,): +x is east, +y up, -z north; to about 0.01 degrees from 1950 to 2050.

    Parameters
    ----------
    when : with a time zone; without one it is universal time.
    latitude, longitude : degrees, north and east.

    Reference: J. Michalsky, "The Astronomical Almanac's algorithm for approximate solar position", Solar Energy
    40(3), 1988. Refraction by the air, 0.5 degrees at the horizon, is left out.
    """
    utc = datetime.timezone.utc
    when = when.replace(tzinfo=utc) if when.tzinfo is None else when.astimezone(utc)
    n = (when - datetime.datetime(2000, 1, 1, 12, tzinfo=utc)).total_seconds() / 86400.0  # days
    anomaly = math.radians(357.528 + 0.9856003 * n)
    ecliptic = math.radians(280.460 + 0.9856474 * n + 1.915 * math.sin(anomaly) + 0.020 * math.sin(2.0 * anomaly))
    tilt = math.radians(23.439 - 4e-7 * n)
    ascension = math.atan2(math.cos(tilt) * math.sin(ecliptic), math.cos(ecliptic))
    declination = math.asin(math.sin(tilt) * math.sin(ecliptic))
    hours = (n + 0.5) % 1.0 * 24.0
    sidereal = 6.697375 + 0.0657098242 * n + hours + longitude / 15.0
    angle, phi = math.radians(15.0 * sidereal) - ascension, math.radians(latitude)
    east = -math.cos(declination) * math.sin(angle)
    north = math.sin(declination) * math.cos(phi) - math.cos(declination) * math.cos(angle) * math.sin(phi)
    up = math.sin(declination) * math.sin(phi) + math.cos(declination) * math.cos(angle) * math.cos(phi)
    return np.array([east, up, -north])
