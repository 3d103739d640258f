"""BOP: the benchmark for 6D poses of objects."""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from sightray.errors import SceneError
from sightray.fields import number, text
from sightray.images.png import write_png
from sightray.vision.bodies import Form, body_of
from sightray.vision.intrinsics import lens_of
from sightray.vision.png16 import png16
from sightray.vision.shot import Shot
from sightray.vision.silhouettes import Silhouette
from sightray.vision.writers.base import Note, Output, Writer, sequences
from sightray.vision.writers.tum import depth_codes


class BopWriter(Writer):
    """BOP: ``SPLIT/SSSSSS/`` with rgb, depth, mask, mask_visib and JSON; ``models/`` and ``camera.json``.

    - ``scene_camera.json``: cam_K, row-major, pixels with the centre of the top-left pixel at (0, 0): 0.5 is subtracted
      from cx and cy; cam_R_w2c, cam_t_w2c world to camera; depth_scale.
    - ``scene_gt.json``: cam_R_m2c, cam_t_m2c model to camera, and obj_id, one more than the object's class in
      ``labels.classes``. Axes of cameras are OpenCV's: +x right, +y down, +z forward. Millimetres.
    - ``scene_gt_info.json``: bbox_obj of the whole outline, also beyond the picture (up to one picture's size each way) and
      behind others, bbox_visib of what is seen; x, y of the first pixel, and last less first, without + 1; -1 if
      nothing is seen. px_count_all counts the whole outline, px_count_valid its pixels in the picture with a depth.
    - ``depth/``: 16-bit PNG, z in units of depth_scale mm, 0 where there is none or it is too far. ``mask/``,
      ``mask_visib/``: IMAGE_OBJECT.png, 0 or 255.
    - ``models/``: the meshes in millimetres with ``models_info.json``.

    Cameras are pinholes, objects meshes whose sizes stay the same in all pictures.
    """

    label: ClassVar[str] = "bop"
    layers: ClassVar[tuple[str, ...]] = ("depth", "instance")
    bytes_per_pixel: ClassVar[float] = 4.0
    depth_scale: float = number("millimetres of one step of the depth", default=0.1, above=0, unit="mm")
    split: str = text("name of the folder of scenes", default="train_pbr")

    def accept(self, shot: Shot) -> None:
        lens_of(shot.labels.camera, self.label)
        for thing in shot.objects:
            body_of(shot.scene.objects[thing.index], self.label)

    def write(self, out: Output, shot: Shot) -> Note:
        labels, folder = shot.labels, f"{self.split}/{shot.sequence:06}"
        out.binary(f"{folder}/rgb/{shot.place:06}.png", shot.png)
        codes = depth_codes(labels.depth, 1000 / self.depth_scale)
        out.binary(f"{folder}/depth/{shot.place:06}.png", png16(codes))
        gt, info, models = [], [], {}
        for k, (thing, outline) in enumerate(zip(shot.objects, shot.silhouettes, strict=True)):
            body = body_of(shot.scene.objects[thing.index], self.label)
            obj_id = labels.classes.index(thing.category) + 1
            models[obj_id] = self._model(out, obj_id, body.form)
            pose = labels.camera_from_world @ body.world_from_body
            gt.append({"cam_R_m2c": _flat(pose[:3, :3]), "cam_t_m2c": _flat(1000 * pose[:3, 3]), "obj_id": obj_id})
            seen = labels.instance == thing.index
            info.append(_info(outline, seen, codes > 0))
            for kind, mask in (("mask", outline.within(labels.width, labels.height)), ("mask_visib", seen)):
                out.binary(f"{folder}/{kind}/{shot.place:06}_{k:06}.png", _mask_file(mask))
        return {**shot.facts(), "place": shot.place, "lens": list(lens_of(labels.camera, self.label)[1:5]),
                "gt": gt, "gt_info": info, "models": models}  # fmt: skip

    def _model(self, out: Output, obj_id: int, form: Form) -> dict[str, float]:
        """Write an object's model, the same in every picture; its line in ``models_info.json``."""
        name, data = f"models/obj_{obj_id:06}.ply", form.ply
        path = out.folder / name
        if path.exists() and path.read_bytes() != data:
            raise SceneError(f"bop: {name}: pictures show bodies of other forms or sizes; allowed: one for each class")
        out.binary(name, data)
        low, high = 1000 * form.vertices.min(axis=0), 1000 * form.vertices.max(axis=0)
        sizes = {f"min_{axis}": float(v) for axis, v in zip("xyz", low, strict=True)}
        sizes |= {f"size_{axis}": float(v) for axis, v in zip("xyz", high - low, strict=True)}
        return {"diameter": 1000 * form.diameter, **sizes}

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        models: dict[str, Any] = {}
        for sequence, found in sequences(notes):
            folder = f"{self.split}/{sequence:06}"
            for note in found:
                models |= note["models"]
            out.json(f"{folder}/scene_camera.json", {str(n["place"]): self._camera(n) for n in found})
            out.json(f"{folder}/scene_gt.json", {str(n["place"]): n["gt"] for n in found})
            out.json(f"{folder}/scene_gt_info.json", {str(n["place"]): n["gt_info"] for n in found})
            fx, fy, cx, cy = found[0]["lens"]
            camera = {"fx": fx, "fy": fy, "cx": cx - 0.5, "cy": cy - 0.5, "width": found[0]["width"],
                      "height": found[0]["height"], "depth_scale": self.depth_scale}  # fmt: skip
            if sequence == 0:
                out.json("camera.json", camera)
        out.json("models/models_info.json", {str(key): models[key] for key in sorted(models, key=int)})

    def _camera(self, note: Note) -> dict[str, Any]:
        fx, fy, cx, cy = note["lens"]
        camera_from_world = np.linalg.inv(note["world_from_camera"])
        return {
            "cam_K": [fx, 0.0, cx - 0.5, 0.0, fy, cy - 0.5, 0.0, 0.0, 1.0], "depth_scale": self.depth_scale,
            "cam_R_w2c": _flat(camera_from_world[:3, :3]), "cam_t_w2c": _flat(1000 * camera_from_world[:3, 3]),
        }  # fmt: skip


def _flat(values: np.ndarray) -> list[float]:
    return values.ravel().tolist()


def _info(outline: Silhouette, seen: np.ndarray, valid: np.ndarray) -> dict[str, Any]:
    """Boxes and counts of pixels of one object."""
    count, visible = outline.pixels(), int(seen.sum())
    inside = outline.within(seen.shape[1], seen.shape[0])
    whole = outline.box() if visible else None
    part = Silhouette(0, 0, seen).box()
    return {
        "bbox_obj": _box(whole), "bbox_visib": _box(part), "px_count_all": count,
        "px_count_valid": int((inside & valid).sum()), "px_count_visib": visible,
        "visib_fract": visible / count if count else 0.0,
    }  # fmt: skip


def _box(box: tuple[int, int, int, int] | None) -> list[int]:
    return [-1, -1, -1, -1] if box is None else [box[0], box[1], box[2] - box[0], box[3] - box[1]]


def _mask_file(mask: np.ndarray) -> bytes:
    stream = io.BytesIO()
    write_png(stream, np.where(mask, 255, 0).astype(np.uint8)[..., None])
    return stream.getvalue()
