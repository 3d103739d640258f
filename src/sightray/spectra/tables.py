"""The wavelengths that spectra are tabulated at, and the tables that the package carries."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

FIRST_NM, LAST_NM = 360, 830
WAVELENGTHS: NDArray[np.float64] = np.arange(FIRST_NM, LAST_NM + 1.0)
"""(471,) float, nm: every nanometre that the CIE's observer covers. Integrals over wavelength are sums over these."""
WAVELENGTHS.flags.writeable = False


def frozen(array: Any) -> NDArray[np.float64]:
    """A contiguous float64 array that cannot be written to."""
    out = np.ascontiguousarray(array, dtype=np.float64)
    out.flags.writeable = False
    return out


@cache
def names_of(table: str) -> tuple[str, ...]:
    """The names of a packaged table's columns, without the first."""
    return tuple(_text(f"{table}.csv").split("\n", 1)[0].split(",")[1:])


@cache
def rows_of(table: str) -> NDArray[np.float64]:
    """A packaged table: nm in the first column, values in the others."""
    return frozen(np.loadtxt(_text(f"{table}.csv").splitlines(), delimiter=",", skiprows=1))


@cache
def indices() -> dict[str, dict[str, Any]]:
    """What is known of each refractive index, by name."""
    return json.loads(_text("indices.json"))


def _text(name: str) -> str:
    return (files("sightray.spectra") / "data" / name).read_text(encoding="utf-8")
