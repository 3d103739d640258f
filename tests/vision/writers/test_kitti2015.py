"""KITTI 2015's layout: what is in the files against rays and projections, without the writer's own formulas."""

from __future__ import annotations

import numpy as np
import pytest
from example_shots import K, example_shots
from reading import read_png

from sightray.errors import SceneError
from sightray.vision.marks import write_shots
from sightray.vision.shot import Shot
from sightray.vision.writers.base import as_writer

HALF = 0.5 / 256 + 1e-12  # of a step of disparity, pixels


@pytest.fixture(scope="module")
def training(tmp_path_factory):
    return write_shots(example_shots(), tmp_path_factory.mktemp("data"), "kitti2015") / "kitti2015/training"


def left(step: int) -> Shot:
    return example_shots()[2 * step]


def codes(path) -> np.ndarray:
    return read_png(path.read_bytes())


def test_pairs_are_complete_and_the_last_picture_is_only_a_second_one(training):
    """Who lists the flow finds both pictures of every pair, in both cameras."""
    names = [path.name for path in sorted((training / "flow_occ").iterdir())]
    assert names == ["000000_10.png", "000001_10.png"]
    for camera in (0, 1):
        folder = training / f"image_{2 + camera}"
        assert len(list(folder.iterdir())) == 5
        for name in names:
            assert (folder / name).is_file()
            second = (folder / name.replace("_10", "_11")).read_bytes()
            assert second == example_shots()[2 * (int(name[:6]) + 1) + camera].png
    for kind in ("flow_noc", "disp_occ_1"):
        assert [path.name for path in sorted((training / kind).iterdir())] == names
    for kind in ("disp_occ_0", "disp_noc_0"):
        assert len(list((training / kind).iterdir())) == 3


def test_flow_is_that_of_the_labels(training):
    labels = left(1).labels
    found, seen = (codes(training / f"{kind}/000001_10.png") for kind in ("flow_occ", "flow_noc"))
    valid = found[..., 2] == 1
    assert np.abs((found[valid, :2] - 2**15) / 64 - labels.flow[valid]).max() <= 0.5 / 64 + 1e-12
    assert ((seen[..., 2] == 1) == (valid & ~labels.occlusion & ~labels.out_of_view)).all()


def test_disparity_without_occlusion_is_where_the_right_camera_meets_the_same_point(training):
    for step in range(3):
        labels = left(step).labels
        every, seen = (codes(training / f"{kind}/{step:06}_10.png")[..., 0] for kind in ("disp_occ_0", "disp_noc_0"))
        rows, columns = np.nonzero(every)
        found = every[rows, columns] / 256
        point, right = labels.position[rows, columns], labels.views["stereo"].camera
        pixel = right.project(point)
        assert np.abs(columns + 0.5 - pixel[:, 0] - found).max() <= HALF
        origins, directions = right.rays(pixel)
        hits = labels.scene.intersect(origins, directions)
        same = (np.linalg.norm(hits.position - point, axis=1) < 1e-6) & (pixel[:, 0] >= 0) & (pixel[:, 0] < right.width)
        assert ((seen[rows, columns] > 0) == same).mean() > 0.999  # edges that rays graze
        assert same.any()
        assert not same.all()
        assert (seen[seen > 0] == every[seen > 0]).all()


def test_disparity_of_the_second_pair_is_where_both_later_cameras_see_the_moved_point(training):
    for step in range(2):
        labels, later = left(step).labels, [example_shots()[2 * (step + 1) + k].labels.camera for k in (0, 1)]
        found = codes(training / f"disp_occ_1/{step:06}_10.png")[..., 0] / 256
        apart = later[0].project(labels.next_position) - later[1].project(labels.next_position)
        there = np.isfinite(labels.position[..., 0])
        assert ((found > 0) == there).all()
        assert np.abs(found - apart[..., 0])[there].max() <= HALF
        assert np.abs(found - labels.disparity)[there].max() > 4 * HALF  # it is not that of the first pair


def test_calibrations_project(training):
    text = (training / "calib_cam_to_cam/000001.txt").read_text()
    lines = {key: np.array(value.split(), float) for key, value in (line.split(":") for line in text.splitlines())}
    shift = K - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    for number, aside in enumerate((0.0, -K[0, 0] * 0.1) * 2):
        matrix = lines[f"P_rect_{number:02}"].reshape(3, 4)
        np.testing.assert_allclose(matrix[:, :3], shift, atol=1e-12)
        np.testing.assert_allclose(matrix[:, 3], [aside, 0, 0], atol=1e-9)
        assert lines[f"S_rect_{number:02}"].tolist() == [64, 48]


def test_more_than_two_cameras_are_refused():
    with pytest.raises(SceneError, match="kitti2015: got 3 cameras; allowed: one, or two side by side"):
        as_writer("kitti2015").accept(Shot(left(0).labels, cameras=("a", "b", "c")))
