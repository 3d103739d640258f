"""Stage 1 of the lecture: ray casting, plain colours of what is nearest."""

from __future__ import annotations

import sightray as sr
from sightray.scenes._stages import stage


def build() -> sr.Scene:
    return stage(1)
