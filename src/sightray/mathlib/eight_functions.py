"""For eight paths at once: functions that the processor has no instruction for."""

from __future__ import annotations

import math

from sightray._jit import kernel
from sightray.mathlib.eights import (
    F64x8,
    abs8d,
    bits8d,
    cosine_of_octant8,
    floor8d,
    floor8i,
    of_bits8d,
    select8d,
    sign8d,
    sine_of_octant8,
    splat8d,
    vmax8d,
    vmin8d,
    whole8d,
)

TAN_22 = math.sqrt(2.0) - 1.0  # tan(pi / 8)
LN_2, REST_OF_LN_2 = 0.6931471804855391, 7.440617110012397e-11  # 33 bits, whose multiples are exact, and the rest
LARGEST, LEAST = 709.7, -708.3  # exponents of e whose powers are doubles of full precision
FRACTION, ONE, BIAS = (1 << 52) - 1, 1023 << 52, 1023  # bits of a double: the fraction, and an exponent of 0
SMALLEST = 2.0**-1022


@kernel
def atan2_8(y: F64x8, x: F64x8) -> F64x8:
    """The angles of the points (x, y), finite ones, to 2 units in the last place; as `math.atan2`, signs of zeros too.

    The angle from the nearest of the axes and diagonals is a polynomial of its tangent.
    """
    a, b = abs8d(y), abs8d(x)
    steep = a > b
    large, small = select8d(steep, a, b), select8d(steep, b, a)
    oblique = small > large * TAN_22
    top, bottom = select8d(oblique, small - large, small), select8d(oblique, small + large, large)
    t = top / select8d(bottom > 0.0, bottom, splat8d(1.0))
    angle = t + t * arc(t * t)
    angle = select8d(oblique, 0.25 * math.pi + angle, angle)
    angle = select8d(steep, 0.5 * math.pi - angle, angle)
    angle = select8d(sign8d(x) < 0.0, math.pi - angle, angle)
    return angle * sign8d(y)


@kernel
def arc(z: F64x8) -> F64x8:
    """atan(t) / t - 1 for z = t², up to tan²(pi / 8), to 6e-18: interpolated at Chebyshev's points."""
    return z * (-0.3333333333333333 + z * (0.1999999999999552 + z * (-0.14285714284666534 + z * (0.11111111015255669
                + z * (-0.09090904578095735 + z * (0.07692183190171728 + z * (-0.06664511438164644
                + z * (0.05858148832731273 + z * (-0.05085449318930035 + z * (0.039231646190551486
                + z * -0.019176872294336067))))))))))  # fmt: skip


@kernel
def circle8(turns: F64x8) -> tuple[F64x8, F64x8]:
    """`warp.circle`: cosines and sines of angles in turns."""
    quarters = floor8d(4.0 * turns + 0.5)
    q = 2.0 * (4.0 * turns - quarters)
    c, s = cosine_of_octant8(q), sine_of_octant8(q)
    quarter = floor8i(quarters) & 3
    odd = (quarter & 1) != 0
    x, y = select8d(odd, s, c), select8d(odd, c, s)
    left = ((quarter + 1) & 2) != 0
    return select8d(left, -x, x), select8d(quarter >= 2, -y, y)


@kernel
def exp8(x: F64x8) -> F64x8:
    """Powers of e to 1 unit in the last place or two; 0 below e^-708, infinite above e^709.

    What is left of a whole number of times ln 2 goes through Taylor's series.
    """
    k = floor8d(vmin8d(vmax8d(x, splat8d(LEAST)), splat8d(LARGEST)) * (1.0 / math.log(2.0)) + 0.5)
    r = x - k * LN_2 - k * REST_OF_LN_2
    power = 1.0 + r * (1.0 + r * (1 / 2 + r * (1 / 6 + r * (1 / 24 + r * (1 / 120 + r * (1 / 720 + r * (1 / 5040
                + r * (1 / 40320 + r * (1 / 362880 + r * (1 / 3628800 + r * (1 / 39916800 + r * (1 / 479001600
                + r * (1 / 6227020800)))))))))))))  # fmt: skip
    power = power * of_bits8d((floor8i(k) + BIAS) << 52)
    return select8d(x < LEAST, splat8d(0.0), select8d(x > LARGEST, splat8d(math.inf), power))


@kernel
def log8(x: F64x8) -> F64x8:
    """Natural logarithms of numbers from 2^-1022 on, to 2e-16 of the logarithm or of 1, whichever is less."""
    bits = bits8d(x)
    exponent = whole8d(((bits >> 52) & 2047) - BIAS)
    m = of_bits8d((bits & FRACTION) | ONE)
    large = m > math.sqrt(2.0)
    m, exponent = select8d(large, 0.5 * m, m), select8d(large, exponent + 1.0, exponent)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    series = z * (1 / 3 + z * (1 / 5 + z * (1 / 7 + z * (1 / 9 + z * (1 / 11 + z * (1 / 13 + z * (1 / 15
                + z * (1 / 17 + z * (1 / 19 + z * (1 / 21))))))))))  # fmt: skip
    return exponent * LN_2 + (2.0 * s + (2.0 * s * series + exponent * REST_OF_LN_2))


@kernel
def pow8(x: F64x8, y: F64x8) -> F64x8:
    """Powers of numbers that are not negative, to about 1e-16 times their exponents of e; 1 where y is 0."""
    power = exp8(y * log8(vmax8d(x, splat8d(SMALLEST))))
    power = select8d(x >= SMALLEST, power, splat8d(0.0))
    return select8d(abs8d(y) > 0.0, power, splat8d(1.0))
