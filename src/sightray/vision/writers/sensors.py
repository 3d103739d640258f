"""What sensors deliver: pictures as numbers, and measured depths."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from sightray.images.png import png_bytes
from sightray.vision.png16 import png16
from sightray.vision.save import facts
from sightray.vision.shot import Shot
from sightray.vision.writers.base import Note, Output, Writer
from sightray.vision.writers.middlebury import pfm


class SensorsWriter(Writer):
    """Sensors: what the camera delivers as ``picture/NNNNNN.png``, what depth sensors measure as ``NAME/NNNNNN.pfm``.

    The numbers of the pictures are written as they are: 8 bits or, beyond that, 16, of which the lower ones are used
    (12 bits: 0 to 4095); with a Bayer pattern there is one channel. Depths are metres along OpenCV's +z, float32, 0 where
    nothing was measured, rows from the *bottom* as in every PFM. ``sensors.json`` says for each picture which devices
    made it, and the camera, with the centre of the top-left pixel at (0.5, 0.5): nothing is shifted. Recipes that name
    sensors have this format without asking for it.
    """

    label: ClassVar[str] = "sensors"
    bytes_per_pixel: ClassVar[float] = 8.0

    def write(self, out: Output, shot: Shot) -> Note:
        name = f"{shot.id:06}"
        files = {}
        if shot.delivered is not None:
            files["picture"] = f"picture/{name}.png"
            out.binary(files["picture"], png_of(shot.delivered))
        for device, depth in shot.measured.items():
            files[device] = f"{device}/{name}.pfm"
            out.binary(files[device], pfm(depth))
        camera = facts(shot.labels)["camera"]
        return {**shot.facts(), "camera_model": camera, "devices": dict(shot.devices), "files": files}

    def finish(self, out: Output, notes: Iterable[Note]) -> None:
        out.json_parts("sensors.json", {"pictures": notes})


def png_of(numbers: np.ndarray) -> bytes:
    """A PNG file of (h, w) or (h, w, 3) uint8 or uint16."""
    return png16(numbers) if numbers.dtype == np.uint16 else png_bytes(numbers)
