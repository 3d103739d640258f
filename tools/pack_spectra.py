"""Pack measured spectra and refractive indices into src/sightray/spectra/data: python tools/pack_spectra.py SOURCE

SOURCE holds the tables as they were published: CSV files of the CIE and of the ColorChecker, and a folder
``refractiveindex`` of YAML pages from refractiveindex.info, named SHELF__BOOK__...__PAGE.yml. What is packed covers
the visible range with some margin. src/sightray/spectra/data/README.md says where each table comes from.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import numpy as np

from sightray.spectra.illuminants import daylight
from sightray.spectra.index_page import read_page

DATA = Path(__file__).parents[1] / "src" / "sightray" / "spectra" / "data"
KEPT_NM = (290.0, 910.0)  # of tabulated indices
NAMES = {  # page -> the name under which it is found, where that is not the page's own
    "main__Ag__nk__Johnson": "Ag",
    "main__Ag__nk__McPeak": "Ag-McPeak",
    "main__Ag__nk__Rakic-BB": "Ag-Rakic",
    "main__Al__nk__Rakic": "Al",
    "main__Al__nk__McPeak": "Al-McPeak",
    "main__Al__nk__Rakic-BB": "Al-Rakic-BB",
    "main__Au__nk__Johnson": "Au",
    "main__Au__nk__McPeak": "Au-McPeak",
    "main__Au__nk__Rakic-BB": "Au-Rakic",
    "main__Cu__nk__Johnson": "Cu",
    "main__Cu__nk__McPeak": "Cu-McPeak",
    "main__Cu__nk__Rakic-BB": "Cu-Rakic",
    "main__Al2O3__nk__Malitson-o": "sapphire",
    "main__C__nk__Peter": "diamond",
    "main__H2O__nk__Daimon-20.0C": "water",
    "main__H2O__nk__Hale": "water-Hale",
    "main__SiO2__nk__Malitson": "fused silica",
    "specs__cargille__index-matching liquids__nk__BK7_matching_liquid": "BK7 matching liquid",
    "specs__hikari__optical__SF10": "SF10-Hikari",
}


def packed(path: Path) -> dict:
    """What the package keeps of one page: all formulas, and of tables the rows around the visible range."""
    entry = {"metal": bool(re.match(r"main__(Ag|Al|Au|Cu)__", path.name)), "page": path.stem.replace("__", "/")}
    for key, value in read_page(path).items():
        table = key in ("n", "k", "nk")
        entry[key] = [row for row in value if KEPT_NM[0] <= row[0] <= KEPT_NM[1]] if table else value
    return entry


def d65(source: Path) -> np.ndarray:
    """The CIE's table, which ends at 780 nm here, continued to 830 nm by the daylight formula that it was made with."""
    table = np.loadtxt(source / "illuminant_D65.csv", delimiter=",", skiprows=1)
    phase = daylight(6500 * 1.4388 / 1.4380)
    nm = np.arange(table[-1, 0] + 5, 831, 5)
    beyond = phase.at(nm) * table[-1, 1] / phase.at(table[-1, 0])
    return np.vstack([table, np.column_stack([nm, np.round(beyond, 4)])])


def main(source: Path) -> None:
    pages = sorted((source / "refractiveindex").glob("*.yml"))
    indices = {NAMES.get(path.stem, path.stem.split("__")[-1]): packed(path) for path in pages}
    lines = [f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in sorted(indices.items())]
    (DATA / "indices.json").write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    for name, target in (("cie1931_2deg_1nm", "observer"), ("illuminant_FL2", "fl2"),
                         ("colorchecker_babelcolor_avg", "colorchecker")):  # fmt: skip
        text = (source / f"{name}.csv").read_text(encoding="utf-8").rstrip("\n")
        (DATA / f"{target}.csv").write_text(text + "\n", encoding="utf-8")
    np.savetxt(DATA / "d65.csv", d65(source), delimiter=",", fmt="%.10g", header="nm,power", comments="")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
