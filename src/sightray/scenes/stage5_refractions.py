"""Stage 5 of the lecture: refracted rays through glass; the whole of Whitted's method."""

from __future__ import annotations

import sightray as sr
from sightray.scenes._stages import stage


def build() -> sr.Scene:
    return stage(5)
