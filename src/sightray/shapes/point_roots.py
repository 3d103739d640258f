"""Roots of the mean distance f of a `PointCloud` along a line, within a stretch of overlapping balls."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f64_at, i64_at
from sightray.mathlib.vec import Vec3, dot
from sightray.shapes.point_splats import ball_normal, ball_point, ball_radius

WORDS = 3  # of a row of the list of balls: where the line enters, where it leaves, which ball


class Line(NamedTuple):
    """A ray's line p + s q, from its point nearest to the cloud's centre on, in a unit direction."""

    p: Vec3
    q: Vec3


@kernel
def mean_distance(balls: Table, rows: Table, first: i64, last: i64, line: Line, s: f64) -> f64:
    """The weighted mean f of the distances to the tangent planes, of the listed balls that hold p + s q."""
    x, total, weights = line.p + line.q * s, 0.0, 0.0
    for i in range(first, last):
        if f64_at(rows, i * WORDS) >= s:
            break
        if f64_at(rows, i * WORDS + 1) > s:
            ball = i64_at(rows, i * WORDS + 2)
            away, r = x - ball_point(balls, ball), ball_radius(balls, ball)
            w = max(0.0, 1.0 - dot(away, away) / (r * r))
            w *= w
            w *= w
            total += w * dot(ball_normal(balls, ball), away)
            weights += w
    return total / weights if weights > 0.0 else math.nan


@kernel
def refine(balls: Table, rows: Table, first: i64, last: i64, line: Line, a: f64, b: f64, fa: f64, fb: f64) -> f64:
    """The root between a and b, where f has different signs: false position (Illinois), and halving where it is slow."""
    side = 0
    for _ in range(200):
        width = b - a
        m = (a * fb - b * fa) / (fb - fa)
        if not a < m < b:
            m = 0.5 * (a + b)
        if m <= a or m >= b:
            break
        fm = mean_distance(balls, rows, first, last, line, m)
        if (fm < 0.0) == (fa < 0.0):
            a, fa = m, fm
            fb = 0.5 * fb if side == -1 else fb
            side = -1
        else:
            b, fb = m, fm
            fa = 0.5 * fa if side == 1 else fa
            side = 1
        if b - a > 0.5 * width and b - a > 0.0:
            m = 0.5 * (a + b)
            fm = mean_distance(balls, rows, first, last, line, m)
            if (fm < 0.0) == (fa < 0.0):
                a, fa = m, fm
            else:
                b, fb = m, fm
            side = 0
        if fa == 0.0:
            return a
        if fb == 0.0:
            return b
    return b


class Range(NamedTuple):
    """Where on the line roots are wanted, as places and as ray parameters t = start + s / speed."""

    low: f64
    high: f64
    start: f64
    speed: f64
    t_min: f64
    t_max: f64


@kernel
def dip(
    balls: Table, rows: Table, first: i64, last: i64, line: Line, a: f64, b: f64, c: f64, fa: f64, fb: f64, fc: f64
) -> f64:
    """Where f has the other sign, of three places with one sign and the smallest value between; NaN if nowhere.

    Follows the vertex of the parabola through the three.
    """
    for _ in range(12):
        p, q = (b - a) * (fb - fc), (b - c) * (fb - fa)
        m = b - 0.5 * ((b - a) * p - (b - c) * q) / (p - q)
        if not a < m < c or m == b:
            break
        fm = mean_distance(balls, rows, first, last, line, m)
        if (fm < 0.0) != (fb < 0.0):
            return m
        if abs(fm) >= abs(fb):
            if m < b:
                a, fa = m, fm
            else:
                c, fc = m, fm
        elif m < b:
            b, c, fb, fc = m, b, fm, fb
        else:
            a, b, fa, fb = b, m, fb, fm
    return math.nan


@kernel
def is_wanted(s: f64, wanted: Range) -> bool:
    """Whether a root lies in the ray."""
    return wanted.t_min < wanted.start + s / wanted.speed < wanted.t_max


@kernel
def root_in_stretch(
    balls: Table, rows: Table, first: i64, last: i64, line: Line, begin: f64, end: f64, n: i64, wanted: Range
) -> f64:
    """The first root that is wanted of a stretch of overlapping balls, sampled n times, or infinity."""
    step = (end - begin) / n
    skipped = min(n, max(0, int((wanted.low - begin) / step) - 3)) if wanted.low > begin else 0
    a, before, f_before = begin + step * skipped, math.nan, math.nan
    fa = mean_distance(balls, rows, first, last, line, a)
    for i in range(skipped + 1, n + 1):
        if a > wanted.high + 2.0 * step:
            return math.inf
        b = begin + step * i if i < n else end
        fb = mean_distance(balls, rows, first, last, line, b)
        if (fa < 0.0 <= fb) or (fb < 0.0 <= fa):
            s = refine(balls, rows, first, last, line, a, b, fa, fb)
            if is_wanted(s, wanted):
                return s
        elif abs(fa) < abs(f_before) and abs(fa) <= abs(fb) and (f_before < 0.0) == (fa < 0.0):
            # The line may touch the surface, or graze it in two places.
            m = dip(balls, rows, first, last, line, before, a, b, f_before, fa, fb)
            if m == m:
                left, right = (before, a) if m < a else (a, b)
                f_left, f_right = (f_before, fa) if m < a else (fa, fb)
                fm = mean_distance(balls, rows, first, last, line, m)
                s = refine(balls, rows, first, last, line, left, m, f_left, fm)
                if is_wanted(s, wanted):
                    return s
                s = refine(balls, rows, first, last, line, m, right, fm, f_right)
                if is_wanted(s, wanted):
                    return s
        before, f_before, a, fa = a, fa, b, fb
    return math.inf
