"""Checkpoints: killed anywhere, a render goes on and ends with the same picture; and only the same render goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import sightray as sr
from sightray.engine.checkpoint import Checkpoint
from sightray.engine.identity import digest_of
from sightray.scenes import build, names


def small(size=40):
    scene = build("cornell")
    return scene.replace(camera=scene.camera.resized(size, size))


def interrupt_after(samples):
    """A progress callback that presses Ctrl-C once so many pixel samples are taken."""

    def press(progress):
        if progress.stage == "render" and progress.done >= samples:
            raise KeyboardInterrupt

    return press


@pytest.mark.parametrize(
    "options",
    [
        {"samples": 24},
        {"samples": 24, "sampler": sr.StratifiedSampler(), "filter": sr.MitchellFilter()},
        {"samples": 24, "sampler": sr.BlueNoiseSampler()},
        {"samples": 24, "adaptive": "error"},
        {"samples": 6, "adaptive": 0.05},
        {"target_error": 0.15},
    ],
    ids=str,
)
def test_interrupted_and_resumed_is_the_uninterrupted_picture(options, tmp_path):
    scene, tracer, file = small(), sr.PathTracer(max_depth=3), tmp_path / "state"
    whole = sr.render(scene, tracer, **options)
    pieces = 0
    while True:
        stop = interrupt_after(2500 * (pieces + 1))
        try:
            resumed = sr.render(scene, tracer, **options, checkpoint=file, resume=pieces > 0, progress=stop)
            break
        except KeyboardInterrupt:
            pieces += 1
    assert pieces >= 2
    assert (np.asarray(resumed) == np.asarray(whole)).all()
    for fact in ("sample_count", "standard_error"):
        np.testing.assert_array_equal(resumed.info[fact], whole.info[fact])
    assert resumed.info["rays"] == whole.info["rays"]
    assert resumed.info["stopped"] == whole.info["stopped"]
    # A finished one goes on from its end: the same picture at once.
    again = sr.render(scene, tracer, **options, checkpoint=file, resume=True, progress=interrupt_after(10**9))
    assert (np.asarray(again) == np.asarray(whole)).all()


def test_states_taken_on_the_way_change_nothing(tmp_path):
    scene, tracer = small(64), sr.PathTracer(max_depth=3)
    whole = sr.render(scene, tracer, samples=32)
    times = []
    original = Checkpoint.save
    try:
        Checkpoint.save = lambda self, state: (times.append(state.rays), original(self, state))
        image = sr.render(scene, tracer, samples=32, checkpoint=tmp_path / "state", checkpoint_every=0.01)
    finally:
        Checkpoint.save = original
    assert len(times) > 3
    assert times == sorted(times)
    assert (np.asarray(image) == np.asarray(whole)).all()
    assert image.info["rays"] == whole.info["rays"]


@pytest.mark.skipif(os.name == "nt", reason="signals differ on Windows")
def test_killed_without_warning_goes_on(tmp_path):
    """SIGKILL, twice, then to the end: the file equals that of an undisturbed process, byte for byte."""
    options = ["--integrator", "path", "--width", "48", "--samples", "768", "--seed", "3"]
    command = [sys.executable, "-m", "sightray", "render", "cornell", *options]
    kept = ["--checkpoint", "state", "--checkpoint-every", "0.05", "--resume"]
    subprocess.run([*command, "-o", "whole.npy", "-q"], cwd=tmp_path, check=True)
    state, killed, written = tmp_path / "state", 0, 0
    while killed < 2:
        process = subprocess.Popen([*command, *kept, "-o", "pieces.npy", "-q"], cwd=tmp_path)
        while process.poll() is None and (not state.exists() or state.stat().st_mtime_ns == written):
            time.sleep(0.01)
        if process.poll() is not None:
            break
        process.send_signal(signal.SIGKILL)
        process.wait()
        written = state.stat().st_mtime_ns
        killed += 1
    assert killed >= 1
    assert not (tmp_path / "pieces.npy").exists()
    subprocess.run([*command, *kept, "-o", "pieces.npy", "-q"], cwd=tmp_path, check=True)
    assert (tmp_path / "pieces.npy").read_bytes() == (tmp_path / "whole.npy").read_bytes()


def test_more_samples_can_be_added_later(tmp_path):
    scene = small(20)
    file = tmp_path / "state"
    sr.render(scene, samples=5, checkpoint=file)
    image = sr.render(scene, samples=30, checkpoint=file, resume=True)
    assert (image.info["sample_count"] == 30).all()
    assert (np.asarray(image) == np.asarray(sr.render(scene, samples=30))).all()


def test_resume_without_a_file_starts_anew(tmp_path):
    image = sr.render(small(8), samples=2, checkpoint=tmp_path / "state", resume=True)
    assert image.info["complete"]
    assert (tmp_path / "state").exists()


def test_another_render_is_refused(tmp_path):
    scene, file = small(16), tmp_path / "state"
    base = {"integrator": sr.PathTracer(), "samples": 2}
    sr.render(scene, **base, checkpoint=file)
    brighter = scene.replace(objects=scene.objects[:-1])
    deeper = base | {"integrator": sr.PathTracer(max_depth=3)}
    for other, options, words in [
        (small(17), base, r"different size: it has 16x16, this has 17x17"),
        (scene, base | {"seed": 1}, r"different seed: it has 0, this has 1"),
        (scene, deeper, r"different integrator: it has PathTracer\(\), this"),
        (scene, base | {"sampler": sr.HaltonSampler()}, r"different sampler: it has SobolSampler\(\)"),
        (scene, base | {"filter": sr.TentFilter()}, r"different filter"),
        (scene, base | {"adaptive": "error"}, r"different kind of stopping"),
        (scene, base | {"samples": 1}, r"it has samples as they come, this has one sample in"),
        (brighter, base, r"checkpoint of another render, with a different scene; render without"),
    ]:
        with pytest.raises(sr.SceneError, match=words):
            sr.render(other, **options, checkpoint=file, resume=True)
    with pytest.raises(sr.SceneError, match="the file exists; resume from it, or remove it first"):
        sr.render(scene, **base, checkpoint=file)


@pytest.mark.parametrize("damage", [b"", b"nonsense", "cut"])
def test_damaged_files_are_told(tmp_path, damage):
    file = tmp_path / "state"
    sr.render(small(16), samples=2, checkpoint=file)
    file.write_bytes(file.read_bytes()[:-200] if damage == "cut" else damage)
    with pytest.raises(sr.FormatError, match="not a checkpoint, or a damaged one"):
        sr.render(small(16), samples=2, checkpoint=file, resume=True)


def test_a_failed_write_leaves_the_old_state(tmp_path, monkeypatch):
    file = tmp_path / "state"
    sr.render(small(16), samples=2, checkpoint=file)
    before = file.read_bytes()

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("sightray.engine.checkpoint.np.savez", full)
    with pytest.warns(UserWarning, match="checkpoint not written: No space left on device"):
        sr.render(small(16), samples=4, checkpoint=file, resume=True)
    assert file.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["state"]


@pytest.mark.parametrize("name", names())
def test_digests_of_scenes_are_the_same_in_every_process(name):
    scene = build(name)
    code = "from sightray.engine.identity import digest_of; from sightray.scenes import build\n"
    code += f"print(digest_of(build({name!r})))"
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                           env={**os.environ, "PYTHONHASHSEED": "5"})  # fmt: skip
    assert other.stdout.strip() == digest_of(scene)
    moved = scene.replace(camera=scene.camera.resized(7, 5))
    assert digest_of(moved) != digest_of(scene)


def test_digests_tell_contents_apart():
    """One number, one vertex, one texel, the place in a group; but not which of two equal objects it is."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])

    def scene(z=0.0, texel=0.5, shift=0.0, order=1):
        mesh = sr.Mesh(vertices=vertices + np.outer([1, 0, 0], [0, 0, z]), faces=[[0, 1, 2]])
        texture = sr.Bitmap(image=np.full((2, 2, 3), texel, np.float32))
        ball = sr.Sphere(material=sr.Lambert(albedo=texture), transform=sr.Transform.translate(shift, 0, 0))
        return sr.Scene(sr.Group(objects=[mesh, ball][::order]), sr.PointLight(position=(0, 4, 0)))

    assert digest_of(scene()) == digest_of(scene())
    found = {digest_of(s) for s in (scene(), scene(z=1e-9), scene(texel=0.6), scene(shift=1), scene(order=-1))}
    assert len(found) == 5
