"""The command line as people use it: what works, and one clear line with exit status 2 for what does not."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import numpy as np
import pytest

import sightray as sr


def sightray(*arguments, cwd=None):
    return subprocess.run(
        [sys.executable, "-m", "sightray", *map(str, arguments)], capture_output=True, text=True, cwd=cwd, timeout=120
    )


def refused(*arguments, cwd=None):
    result = sightray(*arguments, cwd=cwd)
    assert result.returncode == 2, (result.stdout, result.stderr)
    assert "Traceback" not in result.stderr
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def test_render_writes_a_picture(tmp_path):
    out = tmp_path / "w.png"
    result = sightray("render", "whitted", "-o", out, "--width", 64, "--samples", 1)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith(f"{out}: 64x48, ")
    assert "%" in result.stderr  # progress as plain lines
    image = sr.load_image(out)
    assert (image.width, image.height) == (64, 48)
    assert np.asarray(image).std() > 0.1
    quiet = sightray("render", "whitted", "-o", out, "--width", 64, "--samples", 1, "--quiet")
    assert quiet.stderr == ""


def test_default_output_is_beside_the_user_not_the_scene(tmp_path):
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "one.yaml").write_text(
        "camera: {type: PerspectiveCamera, width: 8, height: 8}\nobjects:\n  - {type: Sphere}\n"
    )
    assert sightray("render", "scenes/one.yaml", "-q", cwd=tmp_path).returncode == 0
    assert (tmp_path / "one.png").exists()


def test_same_seed_same_file(tmp_path):
    for name in ("a.npy", "b.npy"):
        sightray(
            "render", "whitted", "-o", tmp_path / name, "--width", 40, "--seed", 7, "--threads", len(name) - 3, "-q"
        )
    assert (tmp_path / "a.npy").read_bytes() == (tmp_path / "b.npy").read_bytes()


def test_progress_bar_on_a_terminal(tmp_path):
    main, end = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "sightray", "render", "whitted", "-o", str(tmp_path / "a.png"), "--width", "320"],
        stderr=end, stdout=subprocess.PIPE, env={**os.environ, "TERM": "xterm"},
    )  # fmt: skip
    os.close(end)
    shown = b""
    try:
        while chunk := os.read(main, 4096):
            shown += chunk
    except OSError:  # how a closed terminal ends
        pass
    assert process.wait(60) == 0
    assert b"Mrays/s" in shown
    assert b"%" in shown


def test_integrators_have_short_names(tmp_path):
    result = sightray("render", "cornell", "--integrator", "path", "--width", 16, "--samples", 2, cwd=tmp_path)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("name", ["sobol", "halton", "stratified", "blue-noise", "Blue_Noise", "independentsampler"])
def test_samplers_have_short_names(name):
    from sightray.cli.common import named_sampler

    assert type(named_sampler(name)).__name__.lower().startswith(name.lower()[:4])


def test_limits_end_a_render_and_are_told(tmp_path):
    options = ["--integrator", "path", "--width", 32, "--sampler", "blue-noise", "-q"]
    timed = sightray("render", "cornell", *options, "--time", 0.3, cwd=tmp_path)
    assert "samples per pixel, relative error" in timed.stdout
    exact = sightray("render", "cornell", *options, "--target-error", 0.5, "--samples", 100000, cwd=tmp_path)
    assert float(exact.stdout.rsplit(maxsplit=1)[1]) <= 0.5


def test_samples_that_are_no_numbers_are_told(tmp_path):
    """A light too bright for numbers: its square overflows."""
    (tmp_path / "a.yaml").write_text(
        "camera: {type: PerspectiveCamera, width: 8, height: 8}\nobjects:\n"
        "  - {type: Sphere}\n  - {type: PointLight, position: [0, 0, 9], intensity: 1.0e+200}\n"
    )
    result = sightray("render", "a.yaml", "-q", cwd=tmp_path)
    assert result.returncode == 0
    assert "samples were no finite numbers" in result.stderr


def test_a_checkpoint_is_resumed_or_refused(tmp_path):
    options = ["cornell", "--width", 16, "--samples", 3, "-q", "--checkpoint", "state"]
    assert sightray("render", *options, cwd=tmp_path).returncode == 0
    assert "the file exists" in refused("render", *options, cwd=tmp_path)
    assert sightray("render", *options, "--resume", cwd=tmp_path).returncode == 0
    assert "different seed: it has 0, this has 1" in refused("render", *options, "--resume", "--seed", 1, cwd=tmp_path)


def test_explain(tmp_path):
    result = sightray("explain", "whitted", "--pixel", "20,30", "--width", 64)
    assert result.returncode == 0, result.stderr
    assert "ray of sight 0" in result.stdout
    assert "sum of all rays" in result.stdout


def test_scenes_are_listed():
    result = sightray("scenes")
    names = [line.split()[0] for line in result.stdout.splitlines()]
    assert {"cornell", "teapot", "spheres", "whitted", "primitives", "sphereflake"} <= set(names)
    assert sum(name.startswith("stage") for name in names) == 5
    assert all(len(line.split(maxsplit=1)[1]) > 10 for line in result.stdout.splitlines())


def test_version():
    assert sightray("--version").stdout.startswith("sightray 0.")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["render", "cornel"], ["cornel", "cornell"]),
        (["render", "missing.yaml"], ["missing.yaml"]),
        (["render", "scene.blend"], ["scene.blend", ".yaml"]),
        (["render", "whitted", "-o", "out.pgn"], ["out.pgn", ".png"]),
        (["render", "whitted", "-o", "nowhere/out.png"], ["nowhere"]),
        (["render", "whitted", "-o", "."], ["."]),
        (["render", "whitted", "--width", "0"], ["width", "got 0"]),
        (["render", "whitted", "--samples", "0"], ["samples", "got 0"]),
        (["render", "whitted", "--integrator", "whited"], ["whited", "did you mean 'Whitted'"]),
        (["render", "whitted", "--adaptive", "7"], ["adaptive", "got 7"]),
        (["render", "whitted", "--adaptive", "eror"], ["adaptive", "did you mean 'error'"]),
        (["render", "whitted", "--sampler", "SobolSamplr"], ["SobolSamplr", "did you mean 'SobolSampler'"]),
        (["render", "whitted", "--time", "0"], ["time", "got 0"]),
        (["render", "whitted", "--resume"], ["checkpoint: missing"]),
        (["render", "whitted", "--checkpoint", "no/state"], ["no/state", "does not exist"]),
        (["render", "a.obj", "--limit", "max_triangles"], ["--limit", "max_triangles"]),
        (["render", "a.obj", "--limit", "max_traingles=5"], ["max_traingles", "max_triangles"]),
        (["explain", "whitted", "--pixel", "1000,1000"], ["pixel", "(1000, 1000)"]),
        (["explain", "whitted", "--pixel", "middle"], ["--pixel", "middle"]),
    ],
)
def test_mistakes_are_one_line(arguments, words, tmp_path):
    line = refused(*arguments, cwd=tmp_path)
    for word in words:
        assert word in line


def test_errors_in_files_name_file_and_line(tmp_path):
    scene = tmp_path / "room.yaml"
    scene.write_text("camera: {type: PerspectiveCamera}\nmaterials:\n  floor:\n    type: Lambert\n    albdo: 0.5\n")
    line = refused("render", scene)
    assert "room.yaml:5: materials.floor: unknown field 'albdo'" in line
    assert "did you mean 'albedo'?" in line
    course = tmp_path / "a.test"
    course.write_text("size 4 4\ncamera 0 0 4 0 0 0 0 1 0 30\nshpere 0 0 0 1\n")
    assert "a.test:3:" in refused("render", course)


def test_an_empty_scene_is_a_mistake(tmp_path):
    (tmp_path / "empty.test").write_text("size 4 4\ncamera 0 0 4 0 0 0 0 1 0 30\n")
    assert "no shapes" in refused("render", "empty.test", cwd=tmp_path)


def test_unwritable_output_is_found_before_rendering(tmp_path):
    kept = tmp_path / "kept.png"
    kept.write_bytes(b"old")
    line = refused("render", "cornell", "--samples", "1000000", "-o", tmp_path / "no" / "kept.png")
    assert "no" in line
    assert kept.read_bytes() == b"old"


def test_a_mesh_with_slivers_is_told_in_one_line(tmp_path):
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\n")
    result = sightray("render", "m.obj", "--width", "32", "-q", cwd=tmp_path)
    assert result.returncode == 0
    assert result.stderr.strip().splitlines() == ["sightray: warning: Mesh: 1 triangles without area were dropped"]
