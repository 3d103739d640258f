"""Stage 4 of the lecture: mirrored rays, recursively."""

from __future__ import annotations

import sightray as sr
from sightray.scenes._stages import stage


def build() -> sr.Scene:
    return stage(4)
