"""COCO: instances and panoptic."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterable, Iterator
from typing import Any, ClassVar

import numpy as np

from sightray.images.png import write_png
from sightray.vision.rle import run_lengths, run_text
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer


class CocoWriter(Writer):
    """COCO: ``images/``, ``annotations/instances.json``, ``panoptic/`` and ``annotations/panoptic.json``.

    Masks are of what is seen, as run lengths down the columns (compressed text); areas count pixels. Boxes are x, y,
    width, height in pixels from the outer edge of the picture's top-left pixel to edges of pixels: its centre is at
    (0.5, 0.5), nothing is shifted. A pixel of ``panoptic/`` holds the id of its segment, R + 256 G + 65536 B: one more
    than the index of the object in the scene; 0 is nothing. The objects that the dataset is about are things, all others
    stuff. Categories are numbered from 1 in the order of their names.
    """

    label: ClassVar[str] = "coco"
    layers: ClassVar[tuple[str, ...]] = ("instance",)
    bytes_per_pixel: ClassVar[float] = 3.2

    def write(self, out: Output, shot: Shot) -> Note:
        name = f"{shot.id:06}.png"
        out.binary(f"images/{name}", shot.png)
        segments = shot.labels.instance + 1
        out.binary(f"panoptic/{name}", _panoptic(segments))
        things = {thing.index for thing in shot.objects}
        found = []
        for thing in shot.labels.objects:
            mask = segments == thing.index + 1
            if mask.any():
                found.append(_segment(thing, mask, thing.index in things))
        return {"id": shot.id, "file_name": name, "width": shot.labels.width, "height": shot.labels.height,
                "segments": found, "classes": _classes(shot, things)}  # fmt: skip

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        kinds: dict[str, bool] = {}
        for note in notes:
            for name, thing in note["classes"].items():
                kinds[name] = kinds.get(name, False) or thing
        number = {name: k for k, name in enumerate(sorted(kinds), 1)}
        things = [{"id": number[name], "name": name} for name in sorted(kinds) if kinds[name]]
        every = [{"id": number[name], "name": name, "isthing": int(kinds[name])} for name in sorted(kinds)]
        out.json_parts("annotations/instances.json", {
            "images": _images(notes), "annotations": _instances(notes, number), "categories": things,
        })  # fmt: skip
        out.json_parts("annotations/panoptic.json", {
            "images": _images(notes), "annotations": _panoptics(notes, number), "categories": every,
        })  # fmt: skip


def _images(notes: Iterable[Note]) -> Iterator[dict[str, Any]]:
    return ({key: note[key] for key in ("id", "file_name", "width", "height")} for note in notes)


def _instances(notes: Iterable[Note], number: dict[str, int]) -> Iterator[dict[str, Any]]:
    """Annotations of the things in all pictures, numbered from 1."""
    ids = itertools.count(1)
    for note in notes:
        for one in note["segments"]:
            if one["thing"]:
                mask = {"size": [note["height"], note["width"]], "counts": one["counts"]}
                yield {"id": next(ids), "image_id": note["id"], **_shared(one, number), "segmentation": mask}


def _panoptics(notes: Iterable[Note], number: dict[str, int]) -> Iterator[dict[str, Any]]:
    """The segments of each picture."""
    for note in notes:
        segments = [{"id": one["id"], **_shared(one, number)} for one in note["segments"]]
        yield {"image_id": note["id"], "file_name": note["file_name"], "segments_info": segments}


def _shared(one: dict[str, Any], number: dict[str, int]) -> dict[str, Any]:
    """What both files say of a segment."""
    return {"category_id": number[one["category"]], "area": one["area"], "bbox": one["bbox"], "iscrowd": 0}


def _segment(thing: Any, mask: np.ndarray, is_thing: bool) -> dict[str, Any]:
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    box = [columns[0], rows[0], columns[-1] + 1 - columns[0], rows[-1] + 1 - rows[0]]
    return {
        "id": thing.index + 1, "category": thing.category, "thing": is_thing, "area": int(mask.sum()),
        "bbox": [float(v) for v in box], "counts": run_text(run_lengths(mask)) if is_thing else "",
    }  # fmt: skip


def _classes(shot: Shot, things: set[int]) -> dict[str, bool]:
    """Names of the classes, and whether they are things: also those of what is not seen in this picture."""
    found: dict[str, bool] = {}
    for thing in shot.labels.objects:
        found[thing.category] = found.get(thing.category, False) or thing.index in things
    return found


def _panoptic(segments: np.ndarray) -> bytes:
    stream = io.BytesIO()
    write_png(stream, np.stack([(segments >> shift) & 255 for shift in (0, 8, 16)], axis=-1).astype(np.uint8))
    return stream.getvalue()
