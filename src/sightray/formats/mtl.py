"""MTL, the material library of OBJ files.

Colours become those of a surface under light as bright as makes a white Lambertian surface white: Kd is an albedo, and
`Phong`, whose colours multiply irradiance itself, gets Kd/pi and Ks/pi. So textured and plain materials match.

==========================================  =====================================================
entries                                     material
==========================================  =====================================================
illum 4, 6, 7 or 9, or d below 1/2          `Glass` of index Ni, tinted by Tf; 1.5 where Ni is 1
map_Kd                                      `Lambert` with that `Bitmap`, instead of Kd
Ks and Ns of at least 1, illum not 0 or 1   `Phong`, with Ks as a mirror too if illum is 3, 5 or 8
else                                        `Lambert`
==========================================  =====================================================

Ke is radiance given off. Ka is not used (exporters write the same constant for every material), nor is Tr, which some
write for transparency and others for its opposite. A texture given with options falls
back on Kd; one that is missing is an error.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from sightray.errors import FormatError
from sightray.formats.base import TEXTURES, Limits, asset, number, read_text, reading
from sightray.materials.glass import Glass
from sightray.materials.lambert import Lambert
from sightray.materials.phong import Phong
from sightray.textures.bitmap import Bitmap

COLORS = ("Kd", "Ks", "Ke", "Tf")
NUMBERS = ("Ns", "Ni", "d", "illum")
Entries = dict[str, Any]


def read_mtl(path: Path, limits: Limits) -> dict[str, Any]:
    """Materials by name."""
    libraries: dict[str, Entries] = {}
    entries: Entries | None = None
    for line, content in enumerate(read_text(path, limits).splitlines(), 1):
        tokens = content.split("#", 1)[0].split()
        if not tokens:
            continue
        word, values = tokens[0], tokens[1:]
        if word == "newmtl":
            entries = libraries.setdefault(" ".join(values), {"line": line})
        elif entries is None:
            raise FormatError(f"{word[:40]!r}; expected newmtl first", path, line)
        elif word in COLORS and values and values[0] not in ("xyz", "spectral"):
            given = [max(0.0, number(token, word, path, line)) for token in values[:3]]
            if len(given) == 2:
                raise FormatError(f"{word}: got 2 numbers; expected 3, or 1 for grey", path, line)
            entries[word] = tuple(given) if len(given) == 3 else (given[0],) * 3
        elif word in NUMBERS and values:
            entries[word] = number(values[-1], word, path, line)  # "d -halo 0.5" has its number last
        elif word == "map_Kd" and values and not values[0].startswith("-"):
            entries[word] = asset(path, content.split(None, 1)[1], TEXTURES, line)  # the name may hold blanks
    result = {}
    for name, found in libraries.items():
        with reading(path, found["line"]):
            result[name] = _material(found)
    return result


def _material(entries: Entries) -> Any:
    diffuse, specular = entries.get("Kd", (0.8,) * 3), entries.get("Ks", (0.0,) * 3)
    emission, shininess, model = entries.get("Ke", 0.0), entries.get("Ns", 0.0), entries.get("illum", 2)
    if model in (4, 6, 7, 9) or entries.get("d", 1.0) < 0.5:
        ior = entries.get("Ni", 1.0)
        tint = tuple(min(1.0, part) for part in entries.get("Tf", (1.0,) * 3))
        return Glass(ior=ior if ior > 0 and ior != 1.0 else 1.5, tint=tint)
    picture = entries.get("map_Kd")
    albedo = tuple(min(1.0, part) for part in diffuse)
    if picture is not None:
        return Lambert(albedo=Bitmap(image=str(picture)), emission=emission)
    if max(specular) > 0 and shininess >= 1 and model not in (0, 1):
        return Phong(
            diffuse=tuple(part / math.pi for part in diffuse), specular=tuple(part / math.pi for part in specular),
            ambient=diffuse, shininess=shininess, emission=emission, mirror=specular if model in (3, 5, 8) else 0.0,
        )  # fmt: skip
    return Lambert(albedo=albedo, emission=emission)
