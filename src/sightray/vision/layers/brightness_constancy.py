"""Brightness constancy, and what breaks it."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.errors import SceneError
from sightray.fields import number
from sightray.vision.constancy import Shading, shade
from sightray.vision.layers.base import Layer
from sightray.vision.layers.flow import pixel_centres
from sightray.vision.legend import Swatches
from sightray.vision.pictures import Painting, palette, title

OUT_OF_VIEW, OCCLUDED, ATTACHED, CAST, SHADING, SPECULAR = 1, 2, 4, 8, 16, 32
INTERREFLECTION, REFRACTION, MOVING_LIGHT = 64, 128, 256
BY_LIGHT = 1 << 16  # times 1 << k: the cast shadow is that of light k
MOST_LIGHTS = 15
REASONS = {
    "out of view": OUT_OF_VIEW, "occluded": OCCLUDED, "attached shadow": ATTACHED, "cast shadow": CAST, "shading": SHADING,
    "specular": SPECULAR, "inter-reflection": INTERREFLECTION, "refraction": REFRACTION, "moving light": MOVING_LIGHT,
}  # fmt: skip


class BrightnessConstancyLayer(Layer):
    """0 where the next picture shows the same point as bright as it is here; else the reasons why not, as bits.

    1 out of view, 2 occluded, 4 attached shadow (the surface turned into it or out), 8 cast shadow, and 65536 << k if it is
    that of light k, 16 shading changed, 32 specular, 64 inter-reflection, 128 refraction, 256 a light moved or changed.
    Bits beyond the first two stand where a channel changes by more than `tolerance`, by Whitted's method at the exact
    places, without noise: I1(x + flow) against I0(x).
    """

    tolerance: float = number("change of radiance that counts as none", default=0.01, above=0, unit="W/(m² sr)")
    label, dtype, background, picture = "brightness_constancy", np.int32, 0, "own"
    letters = "Y"

    def needs(self, frame: Any) -> tuple[str, ...]:
        if len(frame.view.scene.lights) > MOST_LIGHTS:
            raise SceneError(f"label: brightness_constancy: more than {MOST_LIGHTS} lights")
        return ("flow", "occlusion", "out_of_view", "item")

    def compute(self, frame: Any) -> np.ndarray:
        out, occluded = frame.values["out_of_view"].ravel(), frame.values["occlusion"].ravel()
        bits = np.where(out, OUT_OF_VIEW, np.where(occluded, OCCLUDED, 0))
        seen = np.flatnonzero(bits == 0)
        here = pixel_centres(frame.width, frame.height).reshape(-1, 2)[seen]
        there = here + frame.values["flow"].reshape(-1, 2)[seen]
        before, after = shade(frame, here), shade(frame.beside("next"), there)
        lost = np.append(frame.partner_items("next"), -1)[before.item] != after.item  # at an outline, in rounding
        lights = frame.view.scene.lights, frame.other("next").scene.lights
        bits[seen] = np.where(lost, OCCLUDED, self.reasons(before, after, *lights))
        return bits.reshape(frame.height, frame.width).astype(np.int32)

    def reasons(self, a: Shading, b: Shading, lights: tuple[Any, ...], later: tuple[Any, ...]) -> np.ndarray:
        """The bits of points that both pictures see."""
        if len(lights) != len(later):
            raise SceneError(f"label: next: {len(later)} lights; allowed: as many as before, {len(lights)}")
        part = self.tolerance / (3 + 3 * max(1, len(lights)))  # if no part changes by more, neither does the sum
        bits = np.zeros(len(a.item), np.int64)
        bits[_most(b.mirror - a.mirror) > part] |= INTERREFLECTION
        bits[_most(b.through - a.through) > part] |= REFRACTION
        for k, (light, then) in enumerate(zip(lights, later, strict=True)):
            seen0, seen1 = a.seen[:, k, None], b.seen[:, k, None]
            turned = _most((b.matte[:, k] - a.matte[:, k]) * seen1) > part
            shone = _most((b.shine[:, k] - a.shine[:, k]) * seen1) > part
            shaded = _most((a.matte[:, k] + a.shine[:, k]) * (seen1 - seen0)) > part
            edge = (a.before[:, k] == 0) != (b.before[:, k] == 0)
            bits[turned & edge] |= ATTACHED
            bits[turned & ~edge] |= SHADING
            bits[shone] |= SPECULAR
            bits[shaded] |= CAST | BY_LIGHT << k
            if repr(light) != repr(then):
                bits[turned | shone | shaded] |= MOVING_LIGHT
        return np.where(_most(b.color() - a.color()) > self.tolerance, bits, 0)

    def painting(self, labels: Any) -> Painting:
        """Colours of the reasons, mixed where there are several."""
        values = labels[self.label]
        colors = palette(len(REASONS))
        flags = np.stack([(values & bit) != 0 for bit in REASONS.values()], axis=-1)
        count = flags.sum(axis=-1, keepdims=True)
        pixels = np.where(count > 0, flags @ colors / np.maximum(count, 1), 0.92)
        entries = [(np.full(3, 0.92), "constant"), *zip(colors, REASONS, strict=True)]
        return Painting(pixels, Swatches(entries, title(self)))


def _most(change: np.ndarray) -> np.ndarray:
    """The largest change of a channel, (n,)."""
    return np.abs(change).max(axis=-1)
