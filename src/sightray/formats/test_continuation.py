"""Commands that the path tracing assignments added to the course format.

They choose between integrators and how those take samples. What the ray tracer does anyway is accepted.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sightray.errors import FormatError, UnsupportedError, unknown
from sightray.formats.base import number

# What each command chooses from, and what of it the ray tracer does.
CHOICES: dict[str, tuple[tuple[str, ...], str | None]] = {
    "integrator": (("raytracer", "analyticdirect", "direct", "pathtracer"), "raytracer"),
    "lightstratify": (("on", "off"), "off"),
    "nexteventestimation": (("on", "off", "mis"), "off"),
    "russianroulette": (("on", "off"), "off"),
    "importancesampling": (("hemisphere", "cosine", "brdf"), None),
    "brdf": (("phong", "ggx"), "phong"),
}
AMOUNTS: dict[str, float | None] = {"lightsamples": 1.0, "gamma": 1.0, "roughness": None}


def check_continuation(name: str, words: list[str], path: Path, line: int) -> None:
    """Accept what the ray tracer does anyway; an `UnsupportedError` for the rest."""
    if len(words) != 1:
        raise FormatError(f"{name}: got {len(words)} words; expected 1", path, line)
    done: Any
    if name in CHOICES:
        options, done = CHOICES[name]
        value: Any = words[0].lower()
        if value not in options:
            raise FormatError(unknown(f"choice of {name}", words[0][:40], options), path, line)
    else:
        done, value = AMOUNTS[name], number(words[0], name, path, line)
    if value != done:
        only = "" if done is None else f"; allowed: {name} {done if isinstance(done, str) else f'{done:g}'}"
        raise UnsupportedError(f"{path}:{line}: {name} {words[0]}: the ray tracer does not do that{only}")
