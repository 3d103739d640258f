"""Pages of refractiveindex.info: what they state, in the form in which the package keeps it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from sightray.errors import FormatError, SceneError


def read_page(path: Path) -> dict[str, Any]:
    """The data of a page, wavelengths in nm.

    Returns
    -------
    ``reference``; ``formula`` (its number), ``coefficients`` and ``range``, if the page has a formula; ``n``, ``k`` or
    ``nk``, rows of a wavelength and values, if it has such a table.

    Raises
    ------
    SceneError
        No such readable file.
    FormatError
        The file is not such a page.
    """
    import yaml

    try:
        page = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"{path}: cannot be read as text: {getattr(error, 'strerror', None) or error}") from error
    except yaml.YAMLError as error:
        raise FormatError(f"not YAML: {' '.join(str(error).split())}", path) from None
    try:
        # References hold mark-up, which is left out.
        found: dict[str, Any] = {"reference": " ".join(re.sub(r"<[^>]*>", "", page.get("REFERENCES", "")).split())}
        for part in page["DATA"]:
            found.update(_part(part))
    except (TypeError, KeyError, ValueError, AttributeError, IndexError) as error:
        what = f"{type(error).__name__}: {error}"
        raise FormatError(f"not a page of refractiveindex.info, which has DATA of known types ({what})", path) from None
    return found


def _part(part: dict[str, Any]) -> dict[str, Any]:
    """One entry of a page's DATA."""
    kind, name = part["type"].split()
    if kind == "formula":
        return {
            "formula": int(name),
            "coefficients": [float(word) for word in str(part["coefficients"]).split()],
            "range": [_nm(float(word)) for word in str(part["wavelength_range"]).split()],
        }
    if kind != "tabulated" or name not in ("n", "k", "nk"):
        raise ValueError(f"type '{part['type']}'")
    rows = np.array([[float(word) for word in line.split()] for line in part["data"].splitlines() if line.strip()])
    if rows.shape[1] != 1 + len(name):
        raise ValueError(f"rows of {rows.shape[1]} numbers in a table of {name}")
    return {name: [[_nm(row[0]), *row[1:].tolist()] for row in rows]}


def _nm(micrometres: float) -> float:
    return round(1000.0 * micrometres, 6)
