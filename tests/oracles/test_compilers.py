"""Processes that help to compile: with them or without, or with ones that fail, the same is compiled."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from sightray import _compilers, _jit
from sightray._jit import kernel
from sightray.mathlib import warp
from sightray.mathlib.scalars import f64

PICTURE = """
import sys
import numpy as np, sightray as sr
if __name__ == "__main__":
    scene = sr.Scene(sr.Sphere(), sr.Plane(point=(0, -1, 0)), camera=sr.PerspectiveCamera(width=16, height=16))
    np.save(sys.argv[1], np.asarray(sr.render(scene, sr.AmbientOcclusion(), samples=2)))
"""


def test_helpers_fill_the_cache_with_the_same_kernels(tmp_path):
    kept = []
    for compilers in ("1", "3"):
        cache, picture = tmp_path / f"cache{compilers}", tmp_path / f"{compilers}.npy"
        env = {**os.environ, "SIGHTRAY_CACHE_DIR": str(cache), "SIGHTRAY_COMPILERS": compilers}
        subprocess.run([sys.executable, "-c", PICTURE, str(picture)], env=env, check=True)
        kept.append((sorted(path.name for path in cache.iterdir()), picture.read_bytes()))
    assert len(kept[0][0]) >= _compilers.FEWEST
    assert kept[0] == kept[1]


@kernel
def found_nowhere_else(x: f64) -> f64:
    return x


LIBRARY = [warp.concentric, warp.sine_of_octant, warp.cosine_of_octant, warp.circle, warp.cosine_hemisphere,
           warp.power_cosine]  # fmt: skip


@pytest.fixture
def bench(monkeypatch, tmp_path):
    """Nothing is compiled; what this process and its helpers have done is noted, and what was reported."""
    done, reports = [], []
    monkeypatch.setattr(_compilers, "FEWEST", 2)
    monkeypatch.setenv("SIGHTRAY_COMPILERS", "3")
    monkeypatch.setenv("SIGHTRAY_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(_jit, "is_compiled", lambda kernel: kernel in done)
    monkeypatch.setattr(_jit, "address", done.append)
    return done, reports


def test_a_helper_that_cannot_start_is_done_without(bench, monkeypatch):
    done, reports = bench
    monkeypatch.setattr(sys, "executable", "/bin/false" if os.path.exists("/bin/false") else sys.executable)
    kernels = [*LIBRARY, found_nowhere_else]
    _compilers.compile_missing(kernels, 2, lambda *told: reports.append(told))
    assert set(done) >= set(kernels)
    assert reports[-1] == (len(kernels), len(kernels), "")
    assert all(0 <= before <= len(kernels) for before, _, _ in reports)


def test_what_only_this_process_knows_is_compiled_here(bench):
    done, _ = bench
    _compilers.compile_missing([*LIBRARY, found_nowhere_else], 2)
    assert found_nowhere_else in done


def test_nothing_is_started_for_a_few(bench, monkeypatch):
    done, _ = bench
    monkeypatch.setattr(_compilers, "FEWEST", 20)
    monkeypatch.setattr(_compilers, "_Helper", None)
    _compilers.compile_missing(LIBRARY, 2)
    assert sorted(done, key=_compilers._size, reverse=True) == done
    assert set(done) == set(LIBRARY)


@pytest.mark.skipif(os.name != "posix", reason="needs a shell")
def test_a_helper_that_hangs_is_ended(bench, monkeypatch, tmp_path):
    done, _ = bench
    idle = tmp_path / "idle"
    idle.write_text("#!/bin/sh\nexec sleep 60\n")
    idle.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(idle))
    monkeypatch.setattr(_compilers, "PATIENCE", 0.2)
    _compilers.compile_missing([*LIBRARY, found_nowhere_else], 2)
    assert set(done) >= {*LIBRARY, found_nowhere_else}
