"""Rows after plain Python has used them: machine code must find its function pointers unharmed."""

from __future__ import annotations

import numpy as np

import sightray as sr


def test_render_explain_render():
    scene = sr.load("whitted")
    scene = scene.replace(camera=scene.camera.resized(16, 12))
    before = np.asarray(sr.render(scene, samples=1))
    told = sr.explain(scene, pixel=(5, 5))
    after = np.asarray(sr.render(scene, samples=1))
    assert (before == after).all()
    np.testing.assert_allclose(told.color, before[5, 5], rtol=1e-5, atol=1e-7)
