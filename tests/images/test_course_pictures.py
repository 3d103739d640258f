"""Course scenes of our own, byte for byte against a second ray tracer that shares no code with the package."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import sightray as sr

sys.path.insert(0, str(Path(__file__).parent))
import course_oracle

SCENES = sorted((Path(__file__).parent / "scenes").glob("*.test"))


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_picture_is_the_oracles_to_the_byte(path, tmp_path):
    image = sr.render(sr.load(path))
    expected = course_oracle.render(path)
    differs = (image.to_bytes() != expected).any(axis=-1)
    assert differs.mean() < 0.001, f"{differs.sum()} of {differs.size} pixels differ"
    assert len(np.unique(expected.reshape(-1, 3), axis=0)) > 200  # a picture worth comparing
    image.save(tmp_path / "out.png")
    stored = sr.load_image(tmp_path / "out.png", linear=True)
    assert (np.rint(np.asarray(stored) * 255).astype(np.uint8) == image.to_bytes()).all()
