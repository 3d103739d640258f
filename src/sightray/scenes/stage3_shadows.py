"""Stage 3 of the lecture: shadow rays to every light."""

from __future__ import annotations

import sightray as sr
from sightray.scenes._stages import stage


def build() -> sr.Scene:
    return stage(3)
