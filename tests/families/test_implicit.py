"""`Implicit`: what it finds, which expressions it reads, and the interval arithmetic and solvers below it."""

from __future__ import annotations

import numpy as np
import pytest
from test_shapes import Traced

from sightray.errors import SceneError
from sightray.mathlib.expression import compile_expression
from sightray.mathlib.interpret import bound_on_ray
from sightray.mathlib.polynomial import roots_within
from sightray.mathlib.quadratic import quadratic
from sightray.mathlib.table import Table
from sightray.mathlib.vec import Vec3
from sightray.registry import members


def implicit(expression, **options):
    return members("shapes")["Implicit"](expression=expression, **options)


def test_implicit_sees_sheets_of_any_thinness():
    """Two sheets 2e-9 apart, far below any sampling; and one that only touches zero."""
    o, d = np.array([[0.1, 0.3, 5.0]] * 2), np.array([[0.02, -0.03, -1.0]] * 2)
    for text, where in (("(z - 0.3)**2 - 1e-18", 0.3), ("(z - 0.3)**2", 0.3), ("abs(z - 0.3)", 0.3), ("z**3", 0)):
        seen = Traced(implicit(text), o, d)
        assert seen.hit.all(), text
        assert seen.p[0, 2] == pytest.approx(where, abs=1e-5 if text == "z**3" else 2e-8)


def test_implicit_has_no_surface_at_poles_and_outside_of_domains():
    o, d = np.array([[0.1, 0.2, 5.0]]), np.array([[0.0, 0, -1]])
    for text in (
        "1/z",
        "tan(z) + 1/(z - 0.3)",
        "log(-1 - z**2)",
        "sqrt(-1 - z**2)",
        "exp(z)",
        "atan2(z, -1)",
        "1/z**3",
    ):
        assert not Traced(implicit(text), o, d).hit.any(), text


GRAMMAR = [
    ("sin(x) + cos(2*y) - tan(z/3)", lambda x, y, z: np.sin(x) + np.cos(2 * y) - np.tan(z / 3)),
    ("exp(-x**2) * log(y + 3) / (2 + z)", lambda x, y, z: np.exp(-(x**2)) * np.log(y + 3) / (2 + z)),
    ("sqrt(x + 2) - abs(y) + tanh(z)", lambda x, y, z: np.sqrt(x + 2) - np.abs(y) + np.tanh(z)),
    ("min(x, y, z) + max(x*y, z) - hypot(x, z)",
     lambda x, y, z: np.minimum(np.minimum(x, y), z) + np.maximum(x * y, z) - np.hypot(x, z)),
    ("atan2(y, x + 2) + atan(z) + asin(x/2) + acos(y/2)",
     lambda x, y, z: np.arctan2(y, x + 2) + np.arctan(z) + np.arcsin(x / 2) + np.arccos(y / 2)),
    ("sinh(x) - cosh(y) + pow(z + 2, 1.5) + (x+2)**-2 - (y+2)**-0.5 + pi*x**3 - -e",
     lambda x, y, z: np.sinh(x) - np.cosh(y) + (z + 2) ** 1.5 + (x + 2) ** -2.0 - (y + 2) ** -0.5 + np.pi * x**3
     + np.e),
]  # fmt: skip


@pytest.mark.parametrize(("text", "f"), GRAMMAR)
def test_interval_bounds_contain_values_and_slopes(text, f):
    """The span over a stretch of a ray contains what NumPy finds on it; at a point it is tight."""
    code = compile_expression(text)
    rng = np.random.default_rng(0)
    for width in (1.0, 0.1, 0.0):
        for _ in range(15):
            o, d = rng.uniform(-0.9, 0.9, 3), rng.uniform(-0.1, 0.1, 3)
            s = np.linspace(0, width, 41)
            values = f(*(o + s[:, None] * d).T)
            slopes = (f(*(o + (s[:, None] + 1e-5) * d).T) - f(*(o + (s[:, None] - 1e-5) * d).T)) / 2e-5
            b = bound_on_ray(Table(code), len(code), Vec3(*o), Vec3(*d), 0.0, width)
            assert b.x <= values.min() + 1e-14
            assert b.y >= values.max() - 1e-14
            if abs(b.z) < 1e100:
                assert b.z <= slopes.min() + 1e-8
                assert b.w >= slopes.max() - 1e-8
            if width == 0.0:
                assert b.y - b.x < 1e-13
                assert abs(b.w) > 1e100 or b.w - b.z < 1e-11 or "min" in text or "abs" in text


BAD = ["__import__('os')", "x.real", "x if y else z", "[x]", "lambda: x", "x**y", "x**999", "w + 1", "sinn(x)",
       "sin(x, y)", "x ^ 2", "'a'", "1j*x", "True", "x == y", "", "x +", "(" * 300 + "x" + ")" * 300, "-" * 1500 + "x",
       "x, y", "1e999*x", "+".join(["sin(x*y)"] * 200), "x" * 3000, "10**10**10", "max(x)", "sin(a=x)", "\0", "x // y",
       "f'{x}'"]  # fmt: skip


@pytest.mark.parametrize("text", BAD, ids=range(len(BAD)))
def test_expressions_are_not_trusted(text):
    with pytest.raises(SceneError, match=r"Implicit.expression: (column [0-9]+: got .*)?allowed: "):
        implicit(text)


def test_expression_errors_name_the_column():
    with pytest.raises(SceneError, match=r"column 5: got name 'w'; allowed: x, y, z"):
        implicit("x + w")
    with pytest.raises(SceneError, match=r"did you mean 'sin'"):
        implicit("sim(x)")


def test_polynomial_roots_match_numpy():
    rng = np.random.default_rng(1)
    for degree in (1, 2, 3, 4, 5):
        for _ in range(20):
            expected = np.sort(rng.uniform(-2, 2, degree))
            c = np.zeros(8)
            c[: degree + 1] = np.poly(expected)[::-1]
            roots = np.zeros(8)
            count = roots_within(Table(c), degree, -1.0, 1.5, Table(roots))
            within = expected[(expected > -1) & (expected < 1.5)]
            if degree < 2 or np.diff(expected).min() > 1e-3:
                assert roots[:count] == pytest.approx(within, abs=1e-9)


def test_quadratic_keeps_digits_where_the_school_formula_loses_them():
    """W. Kahan, "On the cost of floating-point computation without extra-precise arithmetic", 2004."""
    assert tuple(quadratic(1.0, -1e8, 1.0)) == pytest.approx((5e-9, 2e8), rel=1e-15)
    a, b, c = 94906265.625, 94906267.000, 94906268.375  # the roots differ in the ninth digit
    assert tuple(quadratic(a, -b, c)) == pytest.approx((1.0, 1.000000028975958), rel=1e-15)
    assert tuple(quadratic(0.0, 1.0, -4.0)) == (2.0, 2.0)
    assert np.isnan(quadratic(1.0, 0.0, 1.0)).all()
    assert np.isnan(quadratic(0.0, 0.0, 1.0)).all()
    assert tuple(quadratic(2.0, 0.0, 0.0)) == (0.0, 0.0)
