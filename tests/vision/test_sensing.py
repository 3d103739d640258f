"""Sensors in recipes and at the command line: what is written, that it depends on seed and frame alone, and mistakes."""

from __future__ import annotations

import io
import json
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image
from test_datasets import RECIPE, contents, write_recipe

import sightray as sr
from sightray.errors import FormatError
from sightray.vision.dataset import make_dataset
from sightray.vision.depth_pictures import depth_picture, error_picture
from sightray.vision.depth_sensors.base import known_depth_sensors
from sightray.vision.photograph import photograph
from sightray.vision.recipe import load_recipe
from sightray.vision.writers.base import as_writer
from sightray.vision.writers.sensors import png_of

SENSED = (
    RECIPE
    + """
sensor: {exposure: {uniform: [0.005, 0.02]}, bits: 12, bayer: RGGB}
depth_sensors:
  flight: {type: TimeOfFlight, samples: 2, sensor: {read_noise: 7}}
  stereo: {type: MatchedStereo, dots: {uniform: [3, 9]}, samples: 1, most: 16, window: 5}
  stripes: {type: StructuredLight, samples: 1, columns: 64, rows: 48, period: 8}
  formula: StereoDepth
"""
)
ROOM = """
camera: {type: PerspectiveCamera, eye: [0, 1, 4], target: [0, 0.5, 0], vfov: 40, width: 48, height: 36}
objects:
  - {type: Plane, point: [0, 0, 0], normal: [0, 1, 0]}
  - {type: Sphere, center: [0, 0.5, 0], radius: 0.5}
  - {type: PointLight, position: [2, 4, 3], intensity: 40}
"""


def read_pfm(path) -> np.ndarray:
    kind, size, scale, data = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert (kind, float(scale)) == (b"Pf", -1.0)
    return np.frombuffer(data, "<f4").reshape(height, width)[::-1]


@pytest.fixture(scope="module")
def sensed(tmp_path_factory):
    """A recipe with sensors, and the dataset of its first two frames."""
    folder = tmp_path_factory.mktemp("sensed")
    recipe = write_recipe(folder, SENSED)
    return recipe, make_dataset(recipe, folder / "one", formats=["coco"], frames=2, workers=1, threads=1)


def test_workers_threads_and_order_make_the_same_files(sensed, tmp_path):
    recipe, one = sensed
    two = make_dataset(recipe, tmp_path / "two", formats=["coco"], frames=2, workers=2, threads=2)
    assert contents(one) == contents(two)
    for name in ("picture", "flight", "stereo", "stripes", "formula"):
        assert len(list((one / "sensors" / name).iterdir())) == 2, name


def test_files_are_what_the_sensors_deliver(sensed):
    """Frame 1 made alone, by the public classes, from the take's scene and seeds."""
    recipe, root = sensed
    take = load_recipe(recipe).take(1)
    scene, seed = take.scene.replace(camera=take.cameras["camera"]), take.seeds[0]
    numbers = take.sensor.capture(sr.render(scene, samples=2, seed=seed), seed=seed, frame=1)
    assert (np.array(Image.open(root / "sensors/picture/000001.png")) == numbers).all()
    shown = np.array(Image.open(root / "coco/images/000001.png"))
    assert (shown == np.round(numbers * (255 / 4095)).astype(np.uint8)[..., None]).all()
    for k, (name, device) in enumerate(take.depth_sensors.items()):
        depth = device.capture(scene, seed=seed + 1 + k, frame=1)
        np.testing.assert_array_equal(read_pfm(root / f"sensors/{name}/000001.pfm"), depth.astype(np.float32))
        assert (depth > 0).any(), name
    about = json.loads((root / "sensors/sensors.json").read_text())["pictures"][1]
    assert about["devices"] == {"picture": repr(take.sensor), **{n: repr(d) for n, d in take.depth_sensors.items()}}
    assert about["camera_model"]["intrinsics"][0][2] == 20.0  # the centre of 40 columns: nothing is shifted
    inner = take.depth_sensors["flight"].sensor
    assert (inner.read_noise, inner.full_well) == (7, 100_000)  # what the recipe says, and else the device's own


def test_random_settings_are_drawn_for_each_frame(sensed):
    recipe, _ = sensed
    takes = [load_recipe(recipe).take(k) for k in (0, 1)]
    assert takes[0].sensor.exposure != takes[1].sensor.exposure
    assert takes[0].depth_sensors["stereo"].dots != takes[1].depth_sensors["stereo"].dots


def test_without_samples_nothing_is_sensed_and_without_sensors_nothing_is_added(sensed, tmp_path):
    recipe, _ = sensed
    shot = photograph(load_recipe(recipe).take(0), [as_writer("coco")], 0)[0]
    assert shot.delivered is None
    assert not shot.measured
    plain = make_dataset(write_recipe(tmp_path, RECIPE), tmp_path / "d", formats=["coco"], frames=1, samples=0)
    assert not (plain / "sensors").exists()


def test_pictures_of_8_bits_and_three_channels_are_png_too():
    numbers = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    assert (np.array(Image.open(io.BytesIO(png_of(numbers)))) == numbers).all()


@pytest.mark.parametrize(("text", "said"), [
    ("sensor: {exposur: 1}", r"recipe.yaml:16: sensor: unknown key 'exposur'; did you mean 'exposure'"),
    ("sensor: {bits: 30}", r"recipe.yaml:16: sensor: Sensor.bits: got 30"),
    ("sensor: 3", r"recipe.yaml:16: sensor: expected a mapping"),
    ("depth_sensors: [TimeOfFlight]", r"recipe.yaml:16: depth_sensors: expected depth sensors by name"),
    ("depth_sensors: {a: TimeOfFligth}", r"recipe.yaml:16: depth_sensors.a: unknown type .* did you mean 'TimeOfFlight'"),
    ("depth_sensors: {a: {type: TimeOfFlight, phase: 2}}", r"unknown field 'phase' for TimeOfFlight; did you mean 'phases'"),
    ("depth_sensors: {../a: TimeOfFlight}", r"name '../a'; allowed: letters"),
    ("depth_sensors: {picture: TimeOfFlight}", r"name 'picture'; allowed"),
    ("depth_sensors: {a: {type: TimeOfFlight, sensor: {bits: 0}}}", r"TimeOfFlight.sensor: Sensor.bits: got 0"),
])  # fmt: skip
def test_mistakes_in_recipes_are_told_before_anything_is_made(tmp_path, text, said):
    recipe = write_recipe(tmp_path, RECIPE + text + "\n")
    with pytest.raises(FormatError, match=said):
        make_dataset(recipe, tmp_path / "d", frames=1)
    assert not (tmp_path / "d" / "frames").exists()


def test_cameras_that_a_sensor_cannot_use_are_told_before_anything_is_made(tmp_path):
    fish = RECIPE.replace("type: PerspectiveCamera, vfov: {uniform: [35, 50]}", "type: FisheyeCamera")
    recipe = write_recipe(tmp_path, fish + "depth_sensors: {a: MatchedStereo}\n")
    with pytest.raises(sr.SceneError, match="MatchedStereo: got a scene with FisheyeCamera"):
        photograph(load_recipe(recipe).take(0), [as_writer("exr")], samples=0)  # as before the first frame
    with pytest.raises(sr.SceneError, match="MatchedStereo: got a scene with FisheyeCamera"):
        make_dataset(recipe, tmp_path / "d", formats=["exr"], frames=1)


@pytest.mark.peers
def test_opencv_reads_numbers_and_depths(sensed):
    import cv2

    root = sensed[1] / "sensors"
    raw = cv2.imread(str(root / "picture/000000.png"), cv2.IMREAD_UNCHANGED)
    assert raw.dtype == np.uint16
    assert (raw == np.array(Image.open(root / "picture/000000.png"))).all()
    assert 255 < raw.max() <= 4095
    for name in ("flight", "stereo", "stripes", "formula"):
        depth = cv2.imread(str(root / name / "000000.pfm"), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(depth, read_pfm(root / name / "000000.pfm"))


# --- the command line -----------------------------------------------------------------------------------------------


def sense(*arguments, cwd):
    (cwd / "room.yaml").write_text(ROOM)
    return subprocess.run([sys.executable, "-m", "sightray", "sense", *map(str, arguments)], cwd=cwd, capture_output=True,
                          text=True, timeout=300)  # fmt: skip


def test_sense_writes_pictures_depths_and_errors(tmp_path):
    flight = "{type: time-of-flight, samples: 2, frequencies: [30e6]}"
    result = sense("room.yaml", "-o", "out", "--sensor", "{bits: 8}", "-d", flight, "-d", "stereodepth", "-d", "StereoDepth",
                   "--samples", 2, "--seed", 3, "--frame", 5, "-q", cwd=tmp_path)  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "% measured, median error" in result.stdout
    scene = sr.load(tmp_path / "room.yaml")
    numbers = sr.vision.Sensor(bits=8).capture(sr.render(scene, samples=2, seed=3), seed=3, frame=5)
    assert (np.array(Image.open(tmp_path / "out/picture.png")) == numbers).all()
    assert (np.load(tmp_path / "out/picture.npy") == numbers).all()
    depth = sr.vision.TimeOfFlight(samples=2, frequencies=30e6).capture(scene, seed=3, frame=5)
    assert (np.load(tmp_path / "out/time_of_flight.npy") == depth).all()
    assert (tmp_path / "out/stereo_depth-2_error.png").exists()
    about = json.loads((tmp_path / "out/sensors.json").read_text())
    assert (about["seed"], about["frame"], len(about["sensors"])) == (3, 5, 4)


@pytest.mark.parametrize(("arguments", "said"), [
    (("room.yaml",), "sense: --output: missing"), (("room.yaml", "-o", "out"), "neither --sensor nor --depth-sensor"),
    (("room.yaml", "-o", "out", "-d", "TimeOfFligth"), "did you mean 'TimeOfFlight'"),
    (("room.yaml", "-o", "out", "-d", "{type: TimeOfFlight, phases: 1}"), "TimeOfFlight.phases: got 1; allowed"),
    (("room.yaml", "-o", "out", "-d", "["), "--depth-sensor:"), (("room.yaml", "-o", "out", "-d", "3"), "with 'type'"),
    (("room.yaml", "-o", "out", "--sensor", "{black: 2}"), "Sensor.black: got 2"),
    (("room.yaml", "-o", "out", "--sensor", "{}", "--frame", -1), "frame: got -1"),
])  # fmt: skip
def test_mistakes_are_one_line_and_status_2(tmp_path, arguments, said):
    result = sense(*arguments, "-q", cwd=tmp_path)
    assert result.returncode == 2, result.stderr
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1, lines
    assert said in lines[0]


def test_all_depth_sensors_are_listed(tmp_path):
    result = sense("room.yaml", "-d", "list", cwd=tmp_path)
    assert [line.split()[0] for line in result.stdout.splitlines()] == sorted(known_depth_sensors())


def test_pictures_of_depths_show_near_light_and_errors_by_their_sign():
    depth = np.array([[1.0, 2.0, 0.0, 3.0]])
    shown = np.asarray(depth_picture(depth, "x"))[0]
    assert shown[0].sum() > shown[1].sum() > shown[3].sum()
    assert (shown[2] < 0.03).all()
    shown = np.asarray(error_picture(depth, np.array([[1.1, 1.9, 2.0, 3.0]]), "x"))[0]
    assert shown[0, 2] > shown[0, 0]  # too near: blue
    assert shown[1, 0] > shown[1, 2]  # too far: red
    assert np.ptp(shown[3]) < 1e-6
