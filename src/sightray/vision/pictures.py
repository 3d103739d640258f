"""Label layers as pictures for people: colour maps by name, each with its legend.

Colours are made as sRGB signal, because that is what people compare, and become linear at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sightray.engine.heat import heat
from sightray.errors import SceneError
from sightray.images import Image
from sightray.images.transfer import srgb_decode, srgb_encode
from sightray.vision.legend import Bar, Legend, Patch, Swatches, strip

if TYPE_CHECKING:
    from sightray.vision.labels import Labels
    from sightray.vision.layers.base import Layer

NOTHING = np.array([0.13, 0.13, 0.16])  # sRGB, of pixels without a value
HORIZON = 1e12  # metres; points of the background are farther
MOST_NAMES = 24  # in a legend


class Painting(NamedTuple):
    """A picture, (h, w, 3) sRGB signal, and its legend."""

    pixels: np.ndarray
    legend: Legend


def paint(labels: Labels, name: str, legend: bool) -> Image:
    """A layer as an `Image`, with the legend below."""
    painting = labels.about(name).painting(labels)
    pixels = np.clip(painting.pixels, 0.0, 1.0)
    if legend:
        pixels = np.concatenate([pixels, strip(painting.legend, pixels.shape[1])])
    return Image(srgb_decode(pixels).astype(np.float32))


def by_map(labels: Labels, layer: Layer) -> Painting:
    """The painting that the layer's `picture` names."""
    if layer.picture not in MAPS:
        raise SceneError(f"picture: layer '{layer.label}' is no picture; allowed: layers with a value for every pixel")
    return MAPS[layer.picture](labels, layer, labels[layer.label])


def title(layer: Layer) -> str:
    """Name, unit and frame of a layer."""
    name = layer.label.removesuffix(f"_{layer.frame}").replace("_", " ")
    unit = f" [{layer.unit}]" if layer.unit else ""
    return name + unit + (f" in the {layer.frame} frame" if layer.frame in ("camera", "world", "object") else "")


def palette(count: int) -> np.ndarray:
    """Colours for numbers from 0, (count, 3) sRGB: hues by the golden angle, in three lightnesses."""
    k = np.arange(count)
    hue, value = (0.08 + k * 0.6180339887498949) % 1.0, np.array([0.95, 0.72, 0.84])[k % 3]
    wheel = np.clip(np.abs((hue[:, None] * 6 + [0, 4, 2]) % 6 - 3) - 1, 0, 1)
    return value[:, None] * (1 - np.array([0.72, 0.62, 0.45])[k % 3][:, None] * (1 - wheel))


def heat_colors(value: np.ndarray) -> np.ndarray:
    """From dark violet to pale yellow in even steps of lightness, as sRGB."""
    return srgb_encode(heat(value))


def _heat(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Numbers between the smallest and the largest finite one; near is light."""
    there = np.isfinite(values)
    low, high = (values[there].min(), values[there].max()) if there.any() else (0.0, 1.0)
    part = (np.where(there, values, high) - low) / max(high - low, 1e-300)
    pixels = np.where(there[..., None], heat_colors(1.0 - part), NOTHING)
    return Painting(pixels, Bar(low, high, lambda v: heat_colors(1.0 - v), title(layer)))


def _share(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Shares from 0 to 1; large is light. The last axis, if there is one, is averaged."""
    there = np.isfinite(values)
    pixels = np.where(there[..., None], heat_colors(np.where(there, values, 0.0)), NOTHING)
    return Painting(pixels, Bar(0.0, 1.0, heat_colors, title(layer)))


def _share_of_most(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Numbers from 0 to the largest; large is light."""
    there = np.isfinite(values)
    most = float(values[there].max()) if there.any() else 1.0
    pixels = np.where(there[..., None], heat_colors(np.where(there, values, 0.0) / max(most, 1e-300)), NOTHING)
    return Painting(pixels, Bar(0.0, most, heat_colors, title(layer)))


def _vector(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Vectors: x, y and z as red, green and blue about grey, which is zero."""
    there = np.isfinite(values).all(axis=-1)
    most = float(np.abs(values[there]).max()) if there.any() else 1.0
    pixels = np.where(there[..., None], 0.5 + 0.5 * values / max(most, 1e-300), NOTHING)
    grey, axes = np.full(3, 0.5), 0.5 + 0.5 * np.eye(3)
    entries = [(grey, "0"), *((c, f"{name} = {most:.3g}") for c, name in zip(axes, "xyz", strict=True))]
    return Painting(pixels, Swatches(entries, title(layer)))


def _place(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Pixel coordinates in another picture of about this size: x as red, y as green, in squares of 32 pixels."""
    there = np.isfinite(values).all(axis=-1)[..., None]
    shown = np.where(there, values, 0.0)
    odd = (np.floor(shown[..., 0] / 32) + np.floor(shown[..., 1] / 32)) % 2
    part = shown / (labels.width, labels.height)
    pixels = np.where(there, np.stack([part[..., 0], part[..., 1], 0.3 + 0.4 * odd], axis=-1), NOTHING)
    entries = [(np.array([1.0, 0.1, 0.5]), "x to the right"), (np.array([0.1, 1.0, 0.5]), "y downward"),
               (np.array([0.4, 0.4, 0.7]), "squares of 32 pixels there")]  # fmt: skip
    return Painting(pixels, Swatches(entries, title(layer)))


def shares(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Shares of several lights: the first three as red, green and blue; a single one as grey."""
    there = np.isfinite(values).all(axis=-1) if values.shape[-1] else np.zeros(values.shape[:2], bool)
    colors = np.eye(3) if values.shape[-1] > 1 else np.ones((1, 3))
    shown = np.where(there[..., None], values[..., : len(colors)], 0.0)
    pixels = np.where(there[..., None], shown @ colors[: shown.shape[-1]], NOTHING)
    lights = [f"{k} {type(light).__name__}" for k, light in enumerate(labels.lights)]
    return Painting(pixels, Swatches(list(zip(colors, lights, strict=False)), f"{title(layer)}: 0 black, 1 as below"))


def _direction(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Unit vectors: x, y and z from -1 to 1 as red, green and blue."""
    there = np.isfinite(values).all(axis=-1, keepdims=True)
    pixels = np.where(there, 0.5 + 0.5 * np.where(there, values, 0.0), NOTHING)
    y, x = np.mgrid[1:-1:34j, -1:1:34j]
    inside = x * x + y * y <= 1.0
    z = np.sqrt(np.maximum(0.0, 1.0 - x * x - y * y))
    y, z = (-y, -z) if layer.frame == "camera" else (y, z)
    ball = np.where(inside[..., None], 0.5 + 0.5 * np.stack([x, y, z], axis=-1), 0.0)
    seen = "seen by the camera" if layer.frame == "camera" else "seen from +z, +y up"
    return Painting(pixels, Patch(ball, f"{title(layer)}: x y z as red green blue\nthe same on a ball, {seen}"))


def _box(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Points: x, y and z as red, green and blue, each between the smallest and the largest; nothing where they are far."""
    with np.errstate(invalid="ignore"):
        there = (np.abs(values) < HORIZON).all(axis=-1)
    low, high = np.zeros(3), np.ones(3)
    if there.any():
        low, high = np.percentile(values[there], (1, 99), axis=0)
    part = np.clip((values - low) / np.maximum(high - low, 1e-300), 0.0, 1.0)
    part[..., high == low] = 0.5  # as where rays start that have one eye
    pixels = np.where(there[..., None], part, NOTHING)
    axes = np.eye(3) * 0.9 + 0.1
    ranges = [f"{c} {a:.3g} to {b:.3g}" for c, a, b in zip("xyz", low, high, strict=True)]
    return Painting(pixels, Swatches(list(zip(axes, ranges, strict=True)), title(layer)))


def _cube(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Points of the unit cube: x, y and z as red, green and blue."""
    pixels = np.where(np.isfinite(values).all(axis=-1)[..., None], values, NOTHING)
    axes = [(c, f"{name} 0 to 1") for c, name in zip(np.eye(3) * 0.9 + 0.1, "xyz", strict=True)]
    return Painting(pixels, Swatches(axes, title(layer)))


def _square(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Two numbers as red and green, their whole parts left out, over a fine checker."""
    pixels = np.where(np.isfinite(values).all(axis=-1)[..., None], _uv_colors(values), NOTHING)
    v, u = np.mgrid[1 - 1 / 68 : 1 / 68 : 34j, 1 / 68 : 1 - 1 / 68 : 34j]
    return Painting(
        pixels, Patch(_uv_colors(np.stack([u, v], axis=-1)), f"{title(layer)}: u as red, v as green (upward)")
    )


def _uv_colors(values: np.ndarray) -> np.ndarray:
    part = values - np.floor(values)
    checker = (np.floor(values[..., 0] * 10) + np.floor(values[..., 1] * 10)) % 2
    return np.stack([part[..., 0], part[..., 1], 0.25 + 0.2 * checker], axis=-1)


def _categories(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Numbers as colours, with the names of those that are there."""
    names = names_of(labels, layer)
    count = max(int(values.max()) + 1, 1)
    colors = palette(count)
    pixels = np.where((values >= 0)[..., None], colors[np.maximum(values, 0)], NOTHING)
    there = [int(k) for k in np.unique(values) if k >= 0]
    entries = [(colors[k], names.get(k, str(k))) for k in there[:MOST_NAMES]]
    if len(there) > MOST_NAMES:
        entries.append((np.zeros(3), f"and {len(there) - MOST_NAMES} more"))
    return Painting(pixels, Swatches(entries, title(layer)))


def names_of(labels: Labels, layer: Layer) -> dict[int, str]:
    """What the numbers of a layer stand for."""
    if layer.label == "semantic":
        return dict(enumerate(labels.classes))
    if layer.label == "material":
        return {k: f"{k} {type(m).__name__}" for k, m in enumerate(labels.materials)}
    return {o.index: f"{o.index} {o.name or o.kind}" for o in labels.objects}


def _numbers(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Many numbers as colours, without names."""
    count = len(np.unique(values[values >= 0]))
    pixels = np.where((values >= 0)[..., None], palette(4096)[np.maximum(values, 0) % 4096], NOTHING)
    return Painting(pixels, Swatches([], f"{title(layer)}: {count} different ones"))


def flow_colors(flow: np.ndarray, most: float) -> np.ndarray:
    """Directions as hues, lengths as saturation up to `most`; rightward is red, downward yellow-green."""
    hue = np.arctan2(flow[..., 1], flow[..., 0]) / (2 * np.pi) % 1.0
    wheel = np.clip(np.abs((hue[..., None] * 6 + [0, 4, 2]) % 6 - 3) - 1, 0, 1)
    size = np.clip(np.hypot(flow[..., 0], flow[..., 1]) / max(most, 1e-300), 0, 1)[..., None]
    return 1.0 - size * (1.0 - wheel)


def _flow(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Movements in the picture: direction as hue, length as saturation."""
    there = np.isfinite(values).all(axis=-1)
    size = np.hypot(values[..., 0], values[..., 1])
    most = float(np.percentile(size[there], 99)) if there.any() else 1.0
    pixels = np.where(there[..., None], flow_colors(np.where(there[..., None], values, 0.0), most), NOTHING)
    y, x = np.mgrid[-1:1:42j, -1:1:42j]
    disk = np.where((np.hypot(x, y) <= 1)[..., None], flow_colors(np.stack([x, y], axis=-1), 1.0), 0.0)
    return Painting(pixels, Patch(disk, f"{title(layer)}\nrim of the wheel: {most:.3g} pixels that way"))


def _mask(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """True and false."""
    yes, no = np.array([0.98, 0.8, 0.25]), np.array([0.22, 0.24, 0.42])
    pixels = np.where(values.astype(bool)[..., None], yes, no)
    return Painting(pixels, Swatches([(yes, "yes"), (no, "no")], title(layer)))


def _color(labels: Labels, layer: Layer, values: np.ndarray) -> Painting:
    """Linear colours as they are; those above 1 are scaled down together."""
    there = np.isfinite(values).all(axis=-1)
    most = max(1.0, float(np.percentile(values[there], 97)) if there.any() else 1.0)
    pixels = np.where(there[..., None], srgb_encode(np.clip(np.nan_to_num(values) / most, 0, 1)), NOTHING)
    note = "" if most == 1.0 else f", white is {most:.3g}"
    return Painting(pixels, Swatches([], f"{title(layer)}: linear colour shown as sRGB{note}"))


Map = Callable[["Labels", "Layer", Any], Painting]
MAPS: dict[str, Map] = {
    "heat": _heat, "share": _share, "share_of_most": _share_of_most, "vector": _vector, "shares": shares, "place": _place,
    "direction": _direction, "box": _box, "cube": _cube, "square": _square,
    "categories": _categories, "numbers": _numbers, "flow": _flow, "mask": _mask, "color": _color,
}  # fmt: skip
