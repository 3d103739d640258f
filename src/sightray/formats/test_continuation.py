"""Commands that the path tracing assignments added to the course format: which integrator, and how it takes samples.

========================================  ==========================================================================
``integrator raytracer``                  `Whitted`, with the classic, unnormalised shading
``integrator analyticdirect``             `AnalyticDirect`: kd/pi times Lambert's exact irradiance
``integrator direct``                     `DirectLighting`, sampling every light
``integrator pathtracer``                 `CoursePathTracer`, with a switch for each command of the next four lines
``nexteventestimation on|off|mis``        whether walks look for lights
``importancesampling``                    ``hemisphere``, ``cosine`` or ``brdf``: how they choose directions
``russianroulette on|off``                whether they end by chance
``maxdepth n``                            bounces after the ray of sight; -1 for no bound
``lightsamples n``                        shadow rays to each light
``lightstratify on|off``                  whether those are spread over a grid of cells; n is a square number then
``brdf phong|ggx``, ``roughness a``       materials: kd/pi + ks (s + 2)/(2 pi) max(r.wi, 0)^s, or `CourseGgx`
``gamma g``                               curve of the bytes; 1 and 2.2 are known
========================================  ==========================================================================

A setting that the chosen integrator has no use for is checked and then ignored, because scenes switch integrators by
changing one line.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from sightray.errors import FormatError, UnsupportedError, unknown
from sightray.formats.base import number, whole
from sightray.integrators.analyticdirect import AnalyticDirect
from sightray.integrators.coursepath import CoursePathTracer
from sightray.integrators.directlighting import DirectLighting
from sightray.integrators.whitted import MAX_DEPTH, Whitted
from sightray.lights.area import MAX_GRID
from sightray.lights.rectangle import RectangleLight
from sightray.materials.course_ggx import CourseGgx
from sightray.materials.phong import Phong

CHOICES: dict[str, tuple[str, ...]] = {
    "integrator": ("raytracer", "analyticdirect", "direct", "pathtracer"),
    "lightstratify": ("on", "off"),
    "nexteventestimation": ("on", "off", "mis"),
    "russianroulette": ("on", "off"),
    "importancesampling": ("hemisphere", "cosine", "brdf"),
    "brdf": ("phong", "ggx"),
}
AMOUNTS = ("lightsamples", "gamma", "roughness")
TRANSFERS = {1.0: "floor", 2.2: "gamma2.2"}
MOST_SAMPLES, MOST_BOUNCES = MAX_GRID * MAX_GRID, 1000


class Settings:
    """What the commands of this module have stated so far."""

    def __init__(self, path: Path):
        self.path = path
        self.values: dict[str, Any] = {
            "integrator": "raytracer", "lightstratify": "off", "nexteventestimation": "off", "russianroulette": "off",
            "importancesampling": "hemisphere", "brdf": "phong", "lightsamples": 1, "gamma": 1.0, "roughness": 0.1,
        }  # fmt: skip
        self.samples_line = 0

    def command(self, name: str, words: list[str], line: int) -> None:
        """Take a command, or raise a `FormatError` that names its line."""
        if len(words) != 1:
            raise FormatError(f"{name}: got {len(words)} words; expected 1", self.path, line)
        if name in CHOICES:
            value: Any = words[0].lower()
            if value not in CHOICES[name]:
                raise FormatError(unknown(f"choice of {name}", words[0][:40], CHOICES[name]), self.path, line)
        else:
            value = self.amount(name, words[0], line)
        self.values[name] = value

    def amount(self, name: str, word: str, line: int) -> float:
        """The number of a command, which is in its range."""
        if name == "lightsamples":
            self.samples_line = line
            count = whole(word, name, self.path, line)
            if not 1 <= count <= MOST_SAMPLES:
                raise FormatError(f"{name}: got {word}; expected 1 to {MOST_SAMPLES}", self.path, line)
            return count
        value = number(word, name, self.path, line)
        if name == "roughness" and not 0 < value <= 1:
            raise FormatError(f"{name}: got {word}; expected a number above 0, at most 1", self.path, line)
        if name == "gamma" and value not in TRANSFERS:
            raise UnsupportedError(
                f"{self.path}:{line}: gamma {word}; allowed: {' and '.join(f'{g:g}' for g in TRANSFERS)}"
            )
        return value

    @property
    def surface(self) -> tuple[Any, ...]:
        """What belongs to the material of the next primitive."""
        return self.values["brdf"], self.values["roughness"]

    @property
    def transfer(self) -> str:
        """How bytes are made."""
        return TRANSFERS[self.values["gamma"]]

    def integrator(self, depth: int, line: int) -> Any:
        """The chosen integrator; `depth` was stated in `line`."""
        name, v = self.values["integrator"], self.values
        least, most = {"raytracer": (0, MAX_DEPTH), "pathtracer": (-1, MOST_BOUNCES)}.get(name, (-1, math.inf))
        if not least <= depth <= most:
            allowed = f"allowed for integrator {name}: {least} to {most}"
            raise UnsupportedError(f"{self.path}:{line}: maxdepth {depth}; {allowed}")
        if name == "raytracer":
            return Whitted(max_depth=depth, cutoff=0.0, two_sided=False)
        if name == "analyticdirect":
            return AnalyticDirect()
        repeats = 1 if v["lightstratify"] == "on" else v["lightsamples"]
        if name == "direct":
            return DirectLighting(strategy="light", light_samples=repeats, max_depth=0)
        return CoursePathTracer(
            next_event_estimation=v["nexteventestimation"], importance_sampling=v["importancesampling"],
            russian_roulette=v["russianroulette"] == "on", light_samples=repeats, max_depth=depth,
        )  # fmt: skip

    def quad_light(self, values: list[float]) -> RectangleLight:
        """A light that shines towards -(ab x ac), in as many cells as the chosen integrator looks at."""
        light = RectangleLight(corner=values[:3], edge_u=values[6:9], edge_v=values[3:6], radiance=values[9:])  # type: ignore[arg-type]
        if self.values["integrator"] not in ("direct", "pathtracer"):
            return light
        if self.values["lightstratify"] == "off":
            return light.replace(grid=1)
        count = self.values["lightsamples"]
        if math.isqrt(count) ** 2 != count:
            message = f"lightsamples: got {count}; expected a square number, for lightstratify on"
            raise FormatError(message, self.path, self.samples_line)
        return light.replace(grid=math.isqrt(count))

    def material(self, colors: dict[str, Any], surface: tuple[Any, ...]) -> Any:
        """The material of colours that were stated, for the chosen integrator."""
        name = self.values["integrator"]
        if name == "raytracer":
            return Phong(**colors, mirror=colors["specular"], highlight="blinn")
        if name == "analyticdirect":
            matte: Any = [c / math.pi for c in colors["diffuse"]]
            return Phong(diffuse=matte, specular=0, ambient=0, emission=colors["emission"])
        if surface[0] == "ggx":
            return CourseGgx(diffuse=colors["diffuse"], specular=colors["specular"], roughness=surface[1],
                             emission=colors["emission"])  # fmt: skip
        return Phong(**colors)
