"""The engine: the same picture for any threads, any tiles, any structure, any language it runs in; progress; bad options."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import sightray as sr
from sightray.engine.pixels import render_tile
from sightray.engine.run import run
from sightray.film.film import Film
from sightray.filters.table import filter_table
from sightray.mathlib.table import Space, Table
from sightray.registry import members
from sightray.scene.compile import compile_scene
from sightray.scenes import build

SAMPLER = sr.IndependentSampler()


def small(name="whitted", width=48, height=36):
    scene = build(name)
    return scene.replace(camera=scene.camera.resized(width, height))


@pytest.mark.parametrize("sampler", [cls() for cls in members("samplers").values()], ids=repr)
def test_threads_and_tiles_do_not_change_the_picture(sampler, monkeypatch):
    scene = small(width=100, height=70)
    options = {"samples": 6, "seed": 5, "sampler": sampler, "adaptive": "error"}
    one, three = (np.asarray(sr.render(scene, threads=n, **options)) for n in (1, 3))
    assert (one == three).all()
    monkeypatch.setattr("sightray.engine.run.TILE", 7)
    assert (np.asarray(sr.render(scene, **options)) == one).all()


def test_seeds_change_the_picture_and_threads_do_not():
    scene = small(width=100, height=70)
    one, three = (np.asarray(sr.render(scene, samples=3, seed=5, threads=n)) for n in (1, 3))
    assert (one == three).all()
    assert (one != np.asarray(sr.render(scene, samples=3, seed=6))).any()


def test_machine_code_and_python_see_the_same():
    scene = small(width=12, height=9)
    compiled = compile_scene(scene)
    integrator = scene.integrator
    fast = run(compiled, integrator, SAMPLER, sr.GaussianFilter(), samples=4, seed=3).film
    slow = Film(12, 9)
    compiled.tables.prepare(render_tile, compiled=False)
    space = Space()
    render_tile(
        compiled.world, compiled.tables.row_of(integrator), compiled.tables.row_of(SAMPLER), slow.table,
        filter_table(sr.GaussianFilter(), space), Table(np.full((9, 12), 4, np.int32)),
        space.row(8), 0, 0, 12, 9, 12, 4, 0, 3,
    )  # fmt: skip
    np.testing.assert_allclose(fast.pixels, slow.pixels, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", ["whitted", "sphereflake", "teapot", "cornell"])
def test_tree_and_brute_force_agree(name):
    scene = small(name, 24, 18)
    if name == "sphereflake":
        scene = scene.replace(objects=scene.objects)
    tree, brute = (np.asarray(sr.render(scene, samples=1, accelerator=a)) for a in (None, sr.Brute()))
    np.testing.assert_allclose(tree, brute, rtol=1e-6, atol=1e-7)


def test_one_sample_goes_through_the_centre():
    camera = sr.OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), view_height=4, width=4, height=4)
    marks = [sr.Sphere(center=(x, y, 0), radius=1e-3, material=sr.Lambert(albedo=0, emission=1))
             for x in (-1.5, -0.5, 0.5, 1.5) for y in (-1.5, -0.5, 0.5, 1.5)]  # fmt: skip
    assert (np.asarray(sr.render(sr.Scene(*marks, camera=camera))) == 1).all()


def test_progress_is_told_in_order():
    told = []
    sr.render(small(), samples=4, progress=told.append)
    renders = [p for p in told if p.stage == "render"]
    assert renders[-1].done == renders[-1].total == 48 * 36 * 4
    assert [p.done for p in renders] == sorted(p.done for p in renders)
    assert renders[-1].fraction == 1
    assert renders[-1].rays > 48 * 36 * 4
    assert [p.image() for p in told if p.stage == "compile"] == [None] * (len(told) - len(renders))
    shown = renders[-1].image()
    assert (np.asarray(shown) == np.asarray(sr.render(small(), samples=4))).all()
    first = next(p for p in renders if p.done >= 48 * 36).image()
    assert (np.asarray(first) > 0).any(axis=-1).mean() > 0.95  # a whole picture after one sample


def test_an_exception_in_the_callback_stops_the_render():
    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sr.render(small(), progress=stop)
    image = sr.render(small(), progress=lambda p: stop(p) if p.stage == "render" else None, partial_ok=True)
    assert image.info["complete"] is False


@pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")
def test_ctrl_c_saves_what_there_is(tmp_path):
    out = tmp_path / "big.png"
    process = subprocess.Popen(
        [sys.executable, "-m", "sightray", "render", "whitted", "-o", str(out), "--samples", "100000"],
        stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # background shells have it ignored
    )  # fmt: skip
    line = ""
    while "%" not in line:
        line = process.stderr.readline()
        assert line or process.poll() is None
    time.sleep(0.5)
    pressed = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert time.monotonic() - pressed < 10  # one second on an idle machine
    assert process.returncode == 130
    assert "Traceback" not in err
    assert sr.load_image(out).width == 640


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 0}, "samples: got 0; allowed: a whole number from 1"),
        ({"samples": 2.5}, "samples: got 2.5"),
        ({"adaptive": 2}, "adaptive: got 2"),
        ({"adaptive": "eror"}, "adaptive: got 'eror'; did you mean 'error'"),
        ({"adaptive": 0.1, "target_error": 0.1}, "adaptive: a contrast does not go together with target_error"),
        ({"time": 0}, r"time: got 0; allowed: a number > 0 \(seconds\)"),
        ({"time": float("nan")}, "time: got nan"),
        ({"target_error": -1}, "target_error: got -1"),
        ({"resume": True}, "checkpoint: missing"),
        ({"checkpoint": "nowhere/at/all"}, "the folder 'nowhere/at' does not exist"),
        ({"checkpoint": "x", "checkpoint_every": 0}, "checkpoint_every: got 0"),
        ({"sampler": sr.BoxFilter()}, "sampler: got BoxFilter"),
        ({"threads": 0}, "threads: got 0"),
        ({"filter": sr.Sphere()}, "filter: got Sphere"),
        ({"integrator": "whitted"}, "integrator: got 'whitted'"),
    ],
)
def test_bad_options(options, message):
    with pytest.raises(sr.SceneError, match=message):
        sr.render(small(), **options)


def test_no_camera_and_no_objects():
    with pytest.raises(sr.SceneError, match="camera: missing"):
        sr.render(sr.Scene(sr.Sphere()))
    light = sr.PointLight(position=(0, 0, 0))
    for nothing in (sr.Scene(camera=sr.PerspectiveCamera()), sr.Scene(light, camera=sr.PerspectiveCamera())):
        with pytest.raises(sr.SceneError, match="objects: no shapes; a picture needs at least one"):
            sr.render(nothing)
        with pytest.raises(sr.SceneError, match="no shapes"):
            sr.explain(nothing, pixel=(0, 0))
