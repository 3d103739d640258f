"""Masks and boxes: from one to the other, and as pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sightray.errors import SceneError
from sightray.vision.legend import Swatches
from sightray.vision.pictures import NOTHING, Painting, palette, title

if TYPE_CHECKING:
    from sightray.vision.labels import Labels
    from sightray.vision.layers.base import Layer

MOST = 1 << 32  # bytes


def check_room(frame: Any, label: str, size: int) -> None:
    """Refuse layers with a plane of `size` bytes a pixel for each object that would fill the memory."""
    total = size * len(frame.objects) * frame.width * frame.height
    if total > MOST:
        raise SceneError(
            f"label: {label}: {len(frame.objects)} objects in {frame.width}x{frame.height} pixels take {total >> 20} MiB; "
            f"allowed: {MOST >> 20} MiB. `instance` says the same of what is seen"
        )


def boxes_of(masks: np.ndarray) -> np.ndarray:
    """The box of each mask, (n, 4) float64: left, top, right, bottom edge in pixel coordinates; NaN for empty masks.

    Edges, not centres: a single pixel in column 3 spans 3 to 4.
    """
    boxes = np.full((len(masks), 4), np.nan)
    for k, mask in enumerate(masks):
        columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
        if len(columns):
            boxes[k] = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
    return boxes


def paint_masks(labels: Labels, layer: Layer) -> Painting:
    """The masks of all objects, each in its colour."""
    masks = labels[layer.label]
    colors = palette(len(labels.objects))
    count = masks.sum(axis=0)
    mixed = np.tensordot(masks, colors, axes=(0, 0)) / np.maximum(count, 1)[..., None]
    pixels = np.where(count[..., None] > 0, mixed, NOTHING)
    return Painting(pixels, Swatches(_entries(labels, colors), title(layer)))


def paint_boxes(labels: Labels, layer: Layer) -> Painting:
    """Frames of boxes, (n, 4), over what is seen."""
    colors = palette(len(labels.objects))
    pixels = backdrop(labels, colors)
    for color, box in zip(colors, labels[layer.label], strict=True):
        if np.isfinite(box).all():
            left, top, right, bottom = np.clip(box, 0, np.tile((labels.width, labels.height), 2)).astype(int)
            if left >= right or top >= bottom:  # beyond the picture
                continue
            for outline in (np.s_[top, left:right], np.s_[bottom - 1, left:right],
                            np.s_[top:bottom, left], np.s_[top:bottom, right - 1]):  # fmt: skip
                pixels[outline] = color
    return Painting(pixels, Swatches(_entries(labels, colors), title(layer)))


def backdrop(labels: Labels, colors: np.ndarray) -> np.ndarray:
    """What is seen, darkly, for drawing on."""
    instance = labels.hidden("instance")
    pixels = np.tile(NOTHING, (labels.height, labels.width, 1))
    for color, thing in zip(colors, labels.objects, strict=True):
        pixels[instance == thing.index] = 0.35 * color
    return pixels


def draw_line(pixels: np.ndarray, a: np.ndarray, b: np.ndarray, color: np.ndarray) -> None:
    """A line from pixel coordinates a to b, as far as it is in the picture."""
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        return
    steps = int(min(max(np.abs(b - a).max(), 1), 20_000))
    points = np.floor(a + (b - a) * np.linspace(0, 1, steps + 1)[:, None]).astype(int)
    inside = ((points >= 0) & (points < (pixels.shape[1], pixels.shape[0]))).all(axis=1)
    pixels[points[inside, 1], points[inside, 0]] = color


def _entries(labels: Labels, colors: np.ndarray) -> list[tuple[np.ndarray, str]]:
    return [(c, f"{o.index} {o.name or o.kind}") for c, o in zip(colors, labels.objects, strict=True)]
