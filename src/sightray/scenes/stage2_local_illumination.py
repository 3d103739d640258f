"""Stage 2 of the lecture: local illumination by Phong's model, no shadows."""

from __future__ import annotations

import sightray as sr
from sightray.scenes._stages import stage


def build() -> sr.Scene:
    return stage(2)
