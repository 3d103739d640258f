"""Datasets from recipes: each frame by its number alone, killed and gone on with, by one worker or two, bit for bit."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import sightray as sr
import sightray.scene.compile as compile_module
from sightray.errors import FormatError, SceneError
from sightray.scene.compile import Compiled
from sightray.vision.dataset import make_dataset
from sightray.vision.marks import read_mark, write_frame
from sightray.vision.photograph import photograph
from sightray.vision.recipe import load_recipe
from sightray.vision.writers.base import as_writer
from sightray.vision.writers.exr import ExrWriter

RECIPE = """
seed: 3
samples: 2
frames: 6
ground: {height: 0, area: [[-0.5, -0.5], [0.5, 0.5]]}
place:
  - {shape: {type: Mesh, file: brick.obj}, name: brick, count: {integers: [1, 3]}, size: 0.3, turn: rest,
     material: {type: Lambert, albedo: {hsv: [[0, 360], [0.3, 0.9], [0.4, 0.9]]}}}
view: {target: [0, 0.1, 0], distance: {uniform: [1.2, 2]}, azimuth: {uniform: [0, 360]}, elevation: {uniform: [20, 60]}}
scene:
  camera: {type: PerspectiveCamera, vfov: {uniform: [35, 50]}, width: 40, height: 32}
  background: {uniform: [0.1, 0.6]}
  objects:
    - {type: Plane, point: [0, 0, 0], normal: [0, 1, 0], name: floor}
    - {type: PointLight, position: {around: {distance: [2, 3], elevation: [40, 80]}}, intensity: {log_uniform: [5, 40]}}
"""
SEQUENCE = RECIPE.replace("frames: 6", "frames: 6\nsequence: {length: 3, rate: 20}\nrig: {stereo: 0.1}").replace(
    "elevation: {uniform: [20, 60]}}", "elevation: 30, speed: 40, shake: {position: 0.002, degrees: 0.1, low: 0.5, high: 4}}"
).replace("turn: rest,", "turn: upright, motion: {keyframes: [{time: 0}, {time: 1, transform: [{rotate: {axis: [0, 1, 0], "
          "degrees: 90}}, {translate: [0.1, 0.2, 0]}]}]},")  # fmt: skip
BRICK = "".join(f"v {(k & 1) * 2} {k >> 1 & 1} {(k >> 2 & 1) * 1.5}\n" for k in range(8)) + (
    "f 1 3 2\nf 2 3 4\nf 5 6 7\nf 6 8 7\nf 1 2 5\nf 2 6 5\nf 3 7 4\nf 4 7 8\nf 1 5 3\nf 3 5 7\nf 2 4 6\nf 4 8 6\n"
)
FORMATS = ("coco", "bop", "exr")


@pytest.fixture
def recipe(tmp_path) -> Path:
    return write_recipe(tmp_path, RECIPE)


def write_recipe(folder: Path, text: str) -> Path:
    (folder / "brick.obj").write_text(BRICK)
    (folder / "recipe.yaml").write_text(text)
    return folder / "recipe.yaml"


def contents(root: Path) -> dict[str, bytes]:
    """All files of a dataset but the lock."""
    return {
        str(p.relative_to(root)): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file() and p.name != ".lock"
    }


def test_frames_depend_on_their_number_alone(recipe):
    """In any order, in another process's place, twice."""
    forward, backward = load_recipe(recipe), load_recipe(recipe)
    takes = {k: forward.take(k) for k in range(4)}
    for k in (3, 1, 0, 2):
        a, b = takes[k], backward.take(k)
        assert [repr(thing) for thing in a.scene.objects] == [repr(thing) for thing in b.scene.objects]
        assert repr(a.scene.camera) == repr(b.scene.camera)
        assert (a.seeds, a.targets, a.classes) == (b.seeds, b.targets, b.classes)
    assert len({repr(take.scene.camera) for take in takes.values()}) == 4
    assert load_recipe(recipe, seed=4).take(0).seeds != takes[0].seeds


def test_placed_objects_keep_apart_from_the_scenes_own(tmp_path):
    """A wall of the scene stands across the ground; bricks are on either side of it."""
    wall = "{type: Box, lower: [-0.05, 0, -2], upper: [0.05, 1, 2], name: wall}"
    text = RECIPE.replace("  objects:", f"  objects:\n    - {wall}")
    recipe = load_recipe(
        write_recipe(tmp_path, text.replace("{integers: [1, 3]}", "4").replace("size: 0.3", "size: 0.2"))
    )
    for k in range(5):
        take = recipe.take(k)
        for index in take.targets:
            thing = take.scene.objects[index]
            low, high = bounds(thing)
            assert low[0] > 0.05 or high[0] < -0.05
            assert abs(low[1]) < 1e-12


def bounds(thing) -> tuple[np.ndarray, np.ndarray]:
    from sightray.scene.compile import flatten

    points = np.concatenate([item.transform.point(item.shape.vertices) for item in flatten(sr.Scene(thing))])
    return points.min(axis=0), points.max(axis=0)


def test_what_finds_no_place_is_left_out_and_counted(tmp_path, recipe):
    text = RECIPE.replace("{integers: [1, 3]}", "30").replace("size: 0.3", "size: 0.5")
    take = load_recipe(write_recipe(tmp_path, text)).take(0)
    assert take.note["left_out"] == 30 - len(take.targets) > 0


def test_a_dataset_holds_what_its_manifest_says(recipe, tmp_path):
    import hashlib

    root = make_dataset(recipe, tmp_path / "d", formats=FORMATS)
    manifest = json.loads((root / "manifest.json").read_text())
    assert (manifest["complete"], manifest["frames"], manifest["seed"]) == (True, 6, 3)
    assert set(manifest["recipe"]) == {"recipe.yaml", "brick.obj"}
    known = {"manifest.json"}
    for name, about in manifest["files"].items():
        assert hashlib.sha256((root / name).read_bytes()).hexdigest() == about["sha256"]
        known.add(name)
    for frame, digest in manifest["marks"].items():
        path = root / f"frames/{frame}.json"
        assert hashlib.sha256(path.read_bytes()).hexdigest() == digest
        known.add(f"frames/{frame}.json")
        for name, about in json.loads(path.read_text())["files"].items():
            assert hashlib.sha256((root / name).read_bytes()).hexdigest() == about["sha256"]
            known.add(name)
    assert set(contents(root)) == known
    images = json.loads((root / "coco/annotations/instances.json").read_text())["images"]
    assert [image["id"] for image in images] == list(range(6))


def test_the_picture_is_that_of_render(recipe, tmp_path):
    root = make_dataset(recipe, tmp_path / "d", formats=["coco"], frames=2)
    take = load_recipe(recipe).take(1)
    image = sr.render(take.scene, samples=2, seed=take.seeds[0])
    assert (np.array(Image.open(root / "coco/images/000001.png")) == image.to_bytes()).all()


def test_workers_and_threads_make_the_same_files(recipe, tmp_path):
    one = contents(make_dataset(recipe, tmp_path / "one", formats=FORMATS, workers=1, threads=1))
    two = contents(make_dataset(recipe, tmp_path / "two", formats=FORMATS, workers=2, threads=2))
    assert one.keys() == two.keys()
    assert one == two


def test_e11_labels_do_not_depend_on_the_samples_of_the_pictures(recipe, tmp_path):
    """Pictures of one sample and of four differ; depths, masks and poses beside them are the same to the bit."""
    few, many = (contents(make_dataset(recipe, tmp_path / str(n), formats=["bop"], frames=2, samples=n)) for n in (1, 4))
    assert few.keys() == many.keys()
    differ = {name for name in few if few[name] != many[name]}
    labels = {name for name in few if "/depth/" in name or "/mask" in name or name.endswith(("_gt.json", "_camera.json"))}
    assert len(labels) >= 6
    assert not differ & labels
    assert any("/rgb/" in name for name in differ)


def test_more_frames_leave_the_first_ones_alone(recipe, tmp_path):
    root = make_dataset(recipe, tmp_path / "grown", formats=FORMATS, frames=2)
    times = {p: p.stat().st_mtime_ns for p in root.rglob("exr/*.exr")}
    made = []
    make_dataset(recipe, root, formats=FORMATS, frames=5, progress=made.append)
    assert (made[0].done, made[-1].fresh, made[-1].done) == (2, 3, 5)
    assert all(p.stat().st_mtime_ns == t for p, t in times.items())
    assert contents(root) == contents(make_dataset(recipe, tmp_path / "at_once", formats=FORMATS, frames=5))


def test_a_damaged_frame_is_made_again(recipe, tmp_path):
    root = make_dataset(recipe, tmp_path / "d", formats=FORMATS, frames=3)
    before = contents(root)
    (root / "exr/000001.exr").write_bytes(b"short")
    (root / "frames/000002.json").write_text("{")
    (root / "coco/images/.sightray-0123456789ab.png").write_bytes(b"stray")
    assert [read_mark(root, k) is None for k in range(3)] == [False, True, True]
    made = []
    make_dataset(recipe, root, formats=FORMATS, frames=3, progress=made.append)
    assert made[-1].fresh == 2
    assert contents(root) == before


@pytest.mark.parametrize("workers", [1, 2])
def test_killed_in_the_middle_and_gone_on_with(recipe, tmp_path, workers):
    """SIGKILL, again and again: no frame is lost or made twice, and the result is that of a run in one go."""
    whole = contents(make_dataset(recipe, tmp_path / "whole", formats=FORMATS, frames=6))
    root = tmp_path / "killed"
    command = [sys.executable, "-m", "sightray", "dataset", str(recipe), "-o", str(root), "--format", ",".join(FORMATS),
               "--frames", "6", "--workers", str(workers)]  # fmt: skip
    kept: dict[str, bytes] = {}
    for goal in (1, 3):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        until(lambda goal=goal: len(list(root.glob("frames/0*.json"))) >= goal, process)
        process.kill()
        process.communicate()
        until(lambda: not alive_in(root), None)
        marks = {p.name: p.read_bytes() for p in root.glob("frames/0*.json")}
        assert kept.items() <= marks.items()
        assert all(read_mark(root, int(name[:6])) is not None for name in marks)
        kept = marks
    assert not json.loads((root / "manifest.json").read_text())["complete"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"{6 - len(kept)} made now" in done.stdout
    assert contents(root) == whole


def until(condition, process, seconds: float = 120) -> None:
    """Wait; fail if the process ends before."""
    for _ in range(int(seconds / 0.01)):
        if condition():
            return
        assert process is None or process.poll() is None, process.stderr.read().decode()
        time.sleep(0.01)
    raise AssertionError("waited in vain")


def alive_in(root: Path) -> bool:
    """Whether a worker that lost its master still writes: the folder changes."""
    before = {p: p.stat().st_mtime_ns for p in root.rglob("*") if p.exists()}
    time.sleep(0.5)
    return before != {p: p.stat().st_mtime_ns for p in root.rglob("*") if p.exists()}


def test_interrupted_by_the_keyboard(recipe, tmp_path):
    root = tmp_path / "d"
    command = [sys.executable, "-m", "sightray", "dataset", str(recipe), "-o", str(root), "--frames", "500",
               "--workers", "2"]  # fmt: skip
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # background jobs ignore it
    )  # fmt: skip
    until(lambda: len(list(root.glob("frames/0*.json"))) >= 2, process)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "of 500 frames are complete: the same command goes on" in error
    assert "Traceback" not in error
    assert not list(root.rglob(".sightray-*"))
    marks = len(list(root.glob("frames/0*.json")))
    assert all(read_mark(root, k) is not None for k in range(500) if (root / f"frames/{k:06}.json").exists())
    assert 2 <= marks < 500


def test_sequences_in_stereo_have_flow_and_disparity(tmp_path):
    recipe = write_recipe(tmp_path, SEQUENCE)
    root = make_dataset(recipe, tmp_path / "d", formats=["kitti", "middlebury", "euroc", "tum"], samples=0)
    assert sorted(p.name for p in (root / "kitti/sequences").iterdir()) == ["00", "01"]
    poses = np.loadtxt(root / "kitti/poses/01.txt").reshape(-1, 3, 4)
    assert len(poses) == 3
    takes = [load_recipe(recipe).take(k) for k in (3, 4, 5)]
    truth = [take.cameras["left"].world_from_camera() for take in takes]
    np.testing.assert_allclose(np.linalg.inv(truth[0]) @ truth[2], np.vstack([poses[2], [0, 0, 0, 1]]), atol=1e-12)
    assert [take.time for take in takes] == [0, 0.05, 0.1]
    # The last frame of a sequence has flow, too: to where the next one would be.
    data = (root / "middlebury/sequence_0001_left/flow/000002.flo").read_bytes()
    flow = np.frombuffer(data, "<f4", offset=12)
    assert np.abs(flow[flow < 1e9]).max() > 0.1
    assert len(list((root / "euroc/sequence_0000/mav0/cam1/data").iterdir())) == 3
    scenes = [take.scene.objects[take.targets[0]].transform.matrix for take in takes]
    assert np.abs(scenes[1] - scenes[0]).max() > 1e-3  # the brick moves
    turned = [0.5 * sum(bounds(take.scene.objects[take.targets[0]])) for take in takes]
    np.testing.assert_allclose(turned[2] - turned[0], [0.01, 0.02, 0], atol=1e-12)  # about its own middle


def test_motion_blur_is_in_the_picture_and_not_in_the_labels(tmp_path):
    """The shutter's mean over the pictures of many instants is the blurred picture; labels are those of the middle."""
    text = SEQUENCE.replace("sequence:", "exposure: 0.2\nsequence:").replace("speed: 40", "speed: 60")
    text = text.replace("name: floor", "name: floor, material: {type: Lambert, albedo: {type: Checker, scale: 0.3}}")
    blurred = load_recipe(
        write_recipe(tmp_path, text.replace(", shake: {position: 0.002, degrees: 0.1, low: 0.5, high: 4}", ""))
    )
    take, samples = blurred.take(1), 64
    shot = photograph(take, [], samples)[0]
    still = photograph(replace(take, blurred=None), [], samples)[0]
    assert (shot.labels.instance == still.labels.instance).all()
    animation = blurred.stage(0).animation
    moments = take.time + 0.2 * ((np.arange(40) + 0.5) / 40 - 0.5)
    mean = np.mean([sr.render(animation.at(t), samples=4, seed=k).pixels for k, t in enumerate(moments)], axis=0)
    error = np.abs(shot.image.pixels - mean).mean()
    assert error < 0.3 * np.abs(still.image.pixels - mean).mean()


def test_labels_and_pictures_of_all_cameras_share_the_tables_of_their_scene(tmp_path, monkeypatch):
    """Two cameras, with flow: the tables of two moments, one of which the next frame finds made; pictures bit for bit those
    of `render`."""
    made = []
    monkeypatch.setattr(compile_module, "Compiled", lambda *a: made.append(a) or Compiled(*a))
    recipe = load_recipe(write_recipe(tmp_path, SEQUENCE))
    writers = [as_writer("kitti")]
    takes = [recipe.take(k) for k in range(2)]
    left, right = photograph(takes[0], writers, 2)
    assert len(made) == 2
    photograph(takes[1], writers, 2)
    assert len(made) == 3
    for shot, seed in ((left, takes[0].seeds[0]), (right, takes[0].seeds[1])):
        alone = sr.render(
            takes[0].scene.replace(camera=shot.labels.camera), samples=2, seed=seed, filter=sr.BoxFilter()
        )
        assert (shot.image.pixels == alone.pixels).all()
        depth = sr.label(takes[0].scene, "instance", camera=shot.labels.camera).instance
        assert (shot.labels.instance == depth).all()
    assert (left.image.pixels != right.image.pixels).any()


def test_a_rolling_shutter_is_in_pictures_and_labels(tmp_path):
    """Row by row the labels of the moment of that row; a format with one pose for each picture refuses."""
    text = SEQUENCE.replace("sequence:", "readout: 0.04\nsequence:").replace("speed: 40", "speed: 200")
    path = write_recipe(tmp_path, text.replace(", shake: {position: 0.002, degrees: 0.1, low: 0.5, high: 4}", ""))
    recipe = load_recipe(path)
    take = recipe.take(1)
    shots = photograph(take, [ExrWriter(names="instance,ray_origin,ray_direction")], 1)
    animation = recipe.stage(0).animation
    middle = sr.label(animation.at(take.time), "instance", "depth")
    assert (shots[0].labels.instance != middle.instance).any()
    same, total = 0, 0
    for row in range(0, 32, 5):
        then = animation.at(take.time + 0.04 * ((row + 0.5) / 32 - 0.5))
        still = sr.label(then, "instance", "ray_origin", "ray_direction")
        for name in ("ray_origin", "ray_direction"):  # chords stand in for arcs: a millimetre of a decimetre
            assert np.abs(shots[0].labels[name][row] - still[name][row]).max() <= 2e-3
        same += (shots[0].labels.instance[row] == still.instance[row]).sum()
        total += 40
    assert same >= 0.98 * total
    assert np.ptp(shots[0].labels.ray_origin[..., 0]) + np.ptp(shots[0].labels.ray_origin[..., 2]) > 0.05
    met = shots[0].labels.instance >= 0
    assert np.isfinite(shots[0].labels.flow[met]).mean() > 0.9
    with pytest.raises(SceneError, match="kitti: camera: got a MovingCamera; allowed: pinholes"):
        make_dataset(path, tmp_path / "data", frames=1, formats=["kitti"])
    make_dataset(path, tmp_path / "data", frames=1, samples=1, formats=["coco", "exr"])


def test_a_pair_that_turns_under_a_rolling_shutter_has_disparity(tmp_path):
    """f B over the depth in each row's own pose; the rig turns by 8 degrees while rows are read."""
    text = SEQUENCE.replace("sequence:", "readout: 0.04\nsequence:").replace("speed: 40", "speed: 200")
    take = load_recipe(write_recipe(tmp_path, text)).take(1)
    assert take.stereo
    for shot in photograph(take, [ExrWriter(names="instance,position")], 0):
        labels, camera = shot.labels, take.cameras[shot.cameras[shot.camera]]
        poses = camera.world_from_camera(camera.time_of(np.arange(32) + 0.5))
        assert np.degrees(np.arccos(poses[0][:3, 2] @ poses[-1][:3, 2])) > 4
        depth = np.einsum("rci,ri->rc", labels.position - poses[:, None, :3, 3], poses[:, :3, 2])
        met = labels.instance >= 0
        strength = camera.camera.intrinsics()[0, 0] * 0.1
        np.testing.assert_allclose(labels.disparity[met], strength / depth[met], rtol=1e-9)


# ---------------------------------------------------------------------------------------------------------- what goes wrong


@pytest.mark.parametrize(("old", "new", "said"), [
    ("size: 0.3", "size: [1]", r"recipe.yaml:\d+: size: got \[1\]; allowed: a finite number > 0"),
    ("place:", "palce:", "unknown key 'palce'; did you mean 'place'"),
    ("turn: rest", "turn: tilted", "unknown choice 'tilted'"),
    ("albedo:", "albdo:", "unknown field 'albdo' for Lambert; did you mean 'albedo'"),
    ("brick.obj", "brock.obj", "no such file; did you mean 'brick.obj'"),
    ("{type: PerspectiveCamera, vfov: {uniform: [35, 50]}, width: 40, height: 32}", "", "camera: missing"),
    ("view: {", "view: {distnace: 2, ", "view: unknown key 'distnace'; did you mean 'distance'"),
    ("seed: 3", "seed: 3\nreadout: -1", "readout: got -1; allowed: a finite number >= 0"),
    ("seed: 3", "seed: -3", "seed: got -3; allowed: a whole number from 0"),
    ("seed: 3", "seed: 3\nformats: [cocoa]", "unknown format 'cocoa'; did you mean 'coco'"),
    ("name: floor", "name: floor, radius: 3", "unknown field 'radius' for Plane"),
])  # fmt: skip
def test_wrong_recipes_are_one_line(tmp_path, old, new, said):
    assert old in RECIPE
    recipe = write_recipe(tmp_path, RECIPE.replace(old, new))
    with pytest.raises((SceneError, FormatError), match=said):
        make_dataset(recipe, tmp_path / "d")
    assert not list((tmp_path / "d").rglob("*.png"))


def test_wrong_recipes_at_the_command_line(tmp_path):
    recipe = write_recipe(tmp_path, RECIPE.replace("count", "cuont"))
    done = subprocess.run([sys.executable, "-m", "sightray", "dataset", str(recipe), "-o", str(tmp_path / "d")],
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "recipe.yaml:7: place[0]: unknown key 'cuont'; did you mean 'count'" in done.stderr


def test_another_dataset_is_not_mixed_in(recipe, tmp_path):
    root = make_dataset(recipe, tmp_path / "d", formats=["coco"], frames=1)
    with pytest.raises(SceneError, match="holds a dataset of another seed"):
        make_dataset(recipe, root, formats=["coco"], frames=2, seed=9)
    with pytest.raises(SceneError, match="holds a dataset of another formats"):
        make_dataset(recipe, root, formats=["coco", "exr"], frames=2)
    (tmp_path / "brick.obj").write_text(BRICK + "# changed\n")
    with pytest.raises(SceneError, match="holds a dataset of another recipe"):
        make_dataset(recipe, root, formats=["coco"], frames=2)


def test_random_sizes_are_no_bop(tmp_path):
    recipe = write_recipe(tmp_path, RECIPE.replace("size: 0.3", "size: {uniform: [0.2, 0.3]}"))
    with pytest.raises(SceneError, match="'brick' has a random size"):
        make_dataset(recipe, tmp_path / "d", formats=["bop"])


def test_too_small_a_disk_is_told_before(recipe, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(10**9, 10**9, 10_000))
    with pytest.raises(SceneError, match=r"need about .* GB more, but 0\.00 GB are free"):
        make_dataset(recipe, tmp_path / "d", formats=["exr"], frames=1000)
    assert not list((tmp_path / "d").rglob("*.exr"))


def test_a_disk_that_fills_up_keeps_what_is_complete(recipe, tmp_path, monkeypatch):
    """ENOSPC in the third frame; with room again the dataset is finished and is no other than one made in one go."""
    import sightray.vision.writers.base as base

    write, count = base.Output.binary, 0

    def filling(self, name, data):
        nonlocal count
        count += name.endswith(".png")
        if count > 5:
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            raise OSError(28, "No space left on device")
        write(self, name, data)

    monkeypatch.setattr(base.Output, "binary", filling)
    root = tmp_path / "d"
    with pytest.raises(SceneError, match="frame 2 cannot be written: No space left on device"):
        make_dataset(recipe, root, formats=["coco"], frames=4)
    monkeypatch.setattr(base.Output, "binary", write)
    assert [read_mark(root, k) is not None for k in range(4)] == [True, True, False, False]
    made = []
    make_dataset(recipe, root, formats=["coco"], frames=4, progress=made.append)
    assert made[-1].fresh == 2
    assert contents(root) == contents(make_dataset(recipe, tmp_path / "whole", formats=["coco"], frames=4))


def test_no_folder_can_be_made(recipe, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SceneError, match="no folder that can be written"):
        make_dataset(recipe, tmp_path / "file" / "d")


def test_two_runs_do_not_share_a_folder(recipe, tmp_path):
    fcntl = pytest.importorskip("fcntl")
    root = tmp_path / "d"
    root.mkdir()
    with open(root / ".lock", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(SceneError, match="another run is making this dataset"):
            make_dataset(recipe, root, frames=1)


def test_a_worker_that_dies_is_told(recipe, tmp_path, monkeypatch):
    from sightray.vision.crew import Crew

    hire = Crew._hire

    def doomed(self):
        worker = hire(self)
        os.kill(worker.pid, signal.SIGKILL)
        return worker

    monkeypatch.setattr(Crew, "_hire", doomed)
    with pytest.raises(SceneError, match=r"the worker that made frame \d ended"):
        make_dataset(recipe, tmp_path / "d", workers=2, formats=["coco"])


def test_frames_can_be_written_one_by_one(recipe, tmp_path):
    """What `make_dataset` does, by hand."""
    loaded, writers = load_recipe(recipe), [as_writer("coco")]
    mark = write_frame(tmp_path / "d", photograph(loaded.take(1), writers, 0), writers)
    assert set(mark["files"]) == {"coco/images/000001.png", "coco/panoptic/000001.png"}
