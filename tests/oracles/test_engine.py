"""The engine: the same picture for any threads, any structure, any language it runs in; stopping; adaptive passes."""

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
from sightray.mathlib.table import NULL, Space
from sightray.scene.compile import compile_scene
from sightray.scenes import build

SAMPLER = sr.IndependentSampler()


def small(name="whitted", width=48, height=36):
    scene = build(name)
    return scene.replace(camera=scene.camera.resized(width, height))


def test_threads_do_not_change_the_picture():
    scene = small(width=100, height=70)
    one, three = (np.asarray(sr.render(scene, samples=3, seed=5, threads=n)) for n in (1, 3))
    assert (one == three).all()
    assert (one != np.asarray(sr.render(scene, samples=3, seed=6))).any()


def test_tiles_do_not_change_the_picture(monkeypatch):
    scene = small(width=100, height=70)
    large = np.asarray(sr.render(scene, samples=2))
    monkeypatch.setattr("sightray.engine.run.TILE", 7)
    assert (np.asarray(sr.render(scene, samples=2)) == large).all()


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
        filter_table(sr.GaussianFilter(), space), NULL,
        space.row(8), 0, 0, 12, 9, 12, 0, 4, 3,
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


def test_adaptive_samples_go_where_neighbours_differ():
    camera = sr.OrthographicCamera(eye=(0, 0, 5), target=(0, 0, 0), view_height=4, width=64, height=64)
    edge = sr.Rectangle(corner=(-9, -9, 0), edge_u=(9.01, 3, 0), edge_v=(0, 18, 0),
                        material=sr.Lambert(albedo=0, emission=1))  # fmt: skip
    scene = sr.Scene(edge, camera=camera)
    image = sr.render(scene, samples=4, adaptive=0.1, max_samples=64)
    counts = image.info["sample_count"]
    assert set(np.unique(counts)) == {4, 64}
    assert (counts == 64).mean() < 0.1
    exact = np.asarray(sr.render(scene, samples=1024))
    plain = np.asarray(sr.render(scene, samples=4))
    assert np.abs(np.asarray(image) - exact).max() < 0.25
    assert np.abs(np.asarray(image) - exact).sum() < 0.4 * np.abs(plain - exact).sum()


def test_film_statistics_are_the_sample_statistics():
    scene = small("stage2-local-illumination", 16, 12)
    film = run(compile_scene(scene), scene.integrator, SAMPLER, sr.BoxFilter(), samples=64, seed=1).film
    means = [film.pixels[..., :3] / film.pixels[..., 4:5]]
    for seed in range(2, 12):
        again = run(compile_scene(scene), scene.integrator, SAMPLER, sr.BoxFilter(), samples=64, seed=seed).film
        means.append(again.pixels[..., :3] / again.pixels[..., 4:5])
    spread = (np.array(means) @ [0.2126, 0.7152, 0.0722]).std(axis=0, ddof=1)
    ratio = np.sqrt((spread**2).mean() / (film.standard_error() ** 2).mean())
    assert 0.1 < ratio < 1.05  # stratified samples vary less than independent ones
    assert (film.counts() == 64).all()


def test_progress_is_told_in_order():
    told = []
    sr.render(small(), samples=4, progress=told.append)
    renders = [p for p in told if p.stage == "render"]
    assert renders[-1].done == renders[-1].total == 48 * 36 * 4
    assert [p.done for p in renders] == sorted(p.done for p in renders)
    assert renders[-1].fraction == 1
    assert renders[-1].rays > 48 * 36 * 4


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
