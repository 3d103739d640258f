"""Block matching on pictures whose shift is known, on rendered pairs, and beside OpenCV's."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray.errors import SceneError

AHEAD = sr.Transform.rotate((1, 0, 0), 180)
F, B = 150.0, 0.1
TEXTURE = sr.Lambert(albedo=sr.Noise(scale=14))
LAMP = sr.PointLight(position=(0.5, 1, 1), intensity=20)


def camera(width=128, height=64):
    return sr.PinholeCamera(fx=F, cx=width / 2, cy=height / 2, width=width, height=height, pose=AHEAD)


def wall(z: float, material=TEXTURE):
    return sr.Rectangle(corner=(-9, -9, -z), edge_u=(18, 0, 0), edge_v=(0, 18, 0), material=material, name="wall")


def stereo(**options):
    return sr.vision.MatchedStereo(**{"baseline": B, "most": 32, "samples": 4, **options})


def waves(shift: float, seed: int = 3, height: int = 60, width: int = 160) -> np.ndarray:
    """A picture of 200 waves, none shorter than 5 pixels, moved to the left."""
    random = np.random.default_rng(seed)
    k, phase = random.uniform(-0.2, 0.2, (200, 2)), random.uniform(0, 2 * np.pi, 200)
    y, x = np.mgrid[:height, :width]
    return sum(np.cos(2 * np.pi * (a * (x + shift) + b * y) + p) for (a, b), p in zip(k, phase, strict=True))


@pytest.mark.parametrize("shift", [7.0, 11.25, 12.5, 20.7])
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_pictures_that_are_shifted_are_found(shift, noise):
    """To a tenth of a pixel, without a bias beyond a twentieth, though one eye sees brighter and with less contrast."""
    random = np.random.default_rng(1)
    pair = [waves(s) + noise * random.normal(size=(60, 160)) for s in (0.0, shift)]
    found = stereo().match(pair[0], 0.6 * pair[1] + 40)
    inner = found[4:-4, 4 + 22 : -5]
    assert np.isfinite(inner).mean() > 0.98
    assert np.isnan(found[:4]).all()
    assert np.isnan(found[:, : int(shift)]).all()
    off = inner[np.isfinite(inner)] - shift
    assert abs(np.median(off)) < 0.05
    assert np.sqrt(np.mean(off**2)) < 0.1


def test_each_check_refuses_what_it_is_for():
    even = np.full((40, 120), 7.0)
    assert np.isnan(stereo().match(even, even)).all()
    random = np.random.default_rng(0)
    noise = random.normal(size=(2, 40, 120))
    assert np.isfinite(stereo().match(*noise)).mean() < 0.01
    assert np.isfinite(stereo(likeness=-1, lead=0, agreement=99).match(*noise)).mean() > 0.5
    stripes = np.tile(np.cos(2 * np.pi * np.arange(120) / 8), (40, 1)) + 0.01 * noise[0]
    shifted = np.roll(stripes, -6, axis=1)
    assert np.isfinite(stereo(lead=0.05).match(stripes, shifted))[:, 40:].mean() < 0.01
    assert np.isfinite(stereo(lead=0).match(stripes, shifted))[:, 40:].mean() > 0.2
    left, right = waves(0.0), waves(40.0)  # beyond `most`
    assert np.isfinite(stereo().match(left, right)).mean() < 0.02


def test_what_the_right_picture_sees_elsewhere_is_refused():
    """A piece of the right picture is there twice in the left one: it can only be matched with one of both."""
    right = np.random.default_rng(4).normal(size=(40, 160))
    left = np.roll(right, 5, axis=1)
    left[:, 80:110] = right[:, 60:90]
    trusting, careful = (stereo(agreement=a).match(left, right)[8:-8] for a in (99, 1))
    assert np.nanmedian(trusting[:, 71:76]) == pytest.approx(5, abs=0.2)
    assert np.nanmedian(trusting[:, 86:91]) == pytest.approx(20, abs=0.2)
    both = [np.isfinite(found[:, 71:76]) & np.isfinite(found[:, 86:91]) for found in (trusting, careful)]
    assert both[0].all()
    assert not both[1].any()


def test_holes_are_where_only_one_eye_sees():
    """Beside a card the right eye does not see a strip of the wall; it must not be matched with anything."""
    card = sr.Rectangle(corner=(-0.15, -9, -1), edge_u=(0.3, 0, 0), edge_v=(0, 18, 0), material=TEXTURE, name="card")
    scene = sr.Scene(wall(2.5), card, LAMP, camera=camera(160))
    sensor = stereo(sensor={"read_noise": 0, "shot_noise": False, "bits": 16}, window=7)
    depth = sensor.capture(scene)
    right = scene.replace(camera=sr.vision.stereo_rig(scene.camera, B).at(scene.camera.world_from_camera())["right"])
    labels = sr.label(scene, "depth", "occlusion", "instance", next=right)
    hidden = labels.occlusion.astype(bool)
    assert hidden.sum() > 300
    core = hidden & np.roll(hidden, 3, 1) & np.roll(hidden, -3, 1)
    core[:4] = core[-4:] = False
    assert core.sum() > 100
    assert (depth[core] > 0).mean() < 0.05
    clear = (depth > 0) & ~np.any([np.roll(hidden | (labels.instance == 1), k, 1) for k in range(-9, 10)], axis=0)
    assert clear.sum() > 1000
    assert np.quantile(np.abs(F * B / depth[clear] - F * B / labels.depth[clear]), 0.95) < 0.25


def test_dots_help_where_there_is_no_texture():
    plain = sr.Scene(wall(2.0, sr.Lambert(albedo=0.5)), LAMP, camera=camera())
    assert (stereo().capture(plain) > 0).mean() < 0.02
    depth = stereo(dots=8.0).capture(plain)
    inner = depth[5:-5, 20:-5]
    assert (inner > 0).mean() > 0.9
    assert abs(np.median(F * B / inner[inner > 0]) - F * B / 2.0) < 0.1


def test_what_is_seen_in_a_mirror_is_behind_it():
    """A mirror shows each eye the same virtual wall; so depth is that of the image, metres too far."""
    back = sr.Rectangle(corner=(-9, -9, 2), edge_u=(18, 0, 0), edge_v=(0, 18, 0), material=TEXTURE)
    scene = sr.Scene(wall(1.0, sr.Mirror()), back, sr.PointLight(position=(0, 1, 1.0), intensity=30), camera=camera())
    depth = stereo().capture(scene)
    assert np.median(depth[depth > 0]) == pytest.approx(4.0, abs=0.15)


@pytest.mark.parametrize("z", [1.5, 3.0])
def test_rendered_walls_are_where_they_are(z):
    depth = stereo(window=11).capture(sr.Scene(wall(z), LAMP, camera=camera()), seed=1)
    disparity = F * B / depth[depth > 0]
    assert (depth[6:-6, 20:-6] > 0).mean() > 0.9
    assert abs(np.median(disparity) - F * B / z) < 0.05
    assert np.median(np.abs(disparity - F * B / z)) < 0.15


def test_noise_is_that_of_its_seed_and_frame_for_any_threads():
    scene, sensor = sr.Scene(wall(2.0), LAMP, camera=camera(64, 32)), stereo()
    first = sensor.pictures(scene, seed=1, frame=4, threads=1)
    again, other = sensor.pictures(scene, seed=1, frame=4, threads=2), sensor.pictures(scene, seed=1, frame=5)
    for k in (0, 1):
        assert (first[k] == again[k]).all()
        assert (first[k] != other[k]).any()


@pytest.mark.parametrize(("wrong", "said"), [
    ({"window": 4}, "MatchedStereo.window: got 4; allowed: an odd number"), ({"least": 9, "most": 9}, "MatchedStereo.most"),
    ({"sensor": {"bayer": "RGGB"}}, "without filters"), ({"likeness": 2}, "MatchedStereo.likeness"),
])  # fmt: skip
def test_bad_settings_are_told(wrong, said):
    with pytest.raises(SceneError, match=said):
        sr.vision.MatchedStereo(**wrong)


@pytest.mark.parametrize(("pair", "said"), [
    ((np.zeros((9, 20)), np.zeros((9, 21))), "one size"), ((np.zeros(9), np.zeros(9)), r"\(h, w\)"),
    ((np.full((9, 20), np.nan), np.zeros((9, 20))), "finite"),
])  # fmt: skip
def test_bad_pictures_are_told(pair, said):
    with pytest.raises(SceneError, match=said):
        stereo().match(*pair)


def test_cameras_that_are_no_pinholes_are_told():
    scene = sr.Scene(sr.Sphere(), camera=sr.FisheyeCamera(eye=(0, 0, 4), target=(0, 0, 0)))
    with pytest.raises(SceneError, match=r"MatchedStereo: got a scene with FisheyeCamera.*pinhole"):
        stereo().capture(scene)


@pytest.mark.peers
def test_it_does_no_worse_than_opencvs_block_matching():
    """On a rendered pair of a wall and a ball: share of pixels within one of the true disparity, and their error."""
    import cv2

    scene = sr.Scene(
        wall(2.5), sr.Sphere(center=(0, 0, -1.5), radius=0.3, material=TEXTURE), LAMP, camera=camera(320, 240)
    )
    sensor = stereo(sensor={"bits": 8, "exposure": 0.004})
    left, right = sensor.pictures(scene)
    exact = F * B / sr.label(scene, "depth").depth
    theirs = cv2.StereoBM_create(numDisparities=32, blockSize=9).compute(left, right) / 16.0
    found = [sensor.match(left, right), np.where(theirs > 0, theirs, np.nan)]
    inner = np.s_[8:-8, 44:-8]
    right_share = [(np.abs(d - exact)[inner] < 1).mean() for d in found]
    error = [np.nanmedian(np.abs(d - exact)[inner]) for d in found]
    assert right_share[0] >= right_share[1] - 0.02, (right_share, error)
    assert error[0] <= 1.1 * error[1], (right_share, error)
