"""Every format read back by its own library: `pip install sightray[test,datasets]`, `pytest -m peers`.

E8 of the specification: values within half a unit of the last bit; integer formats bit for bit. E10: what is exported
reprojects, in each target's own convention, with a bias of at most 0.01 pixels.
"""

from __future__ import annotations

import json
import os
from importlib import import_module

import numpy as np
import pytest
import yaml
from example_shots import HEIGHT, WIDTH, K, block, example_shots

import sightray as sr
from sightray.vision.marks import write_shots
from sightray.vision.rle import run_lengths, run_text
from sightray.vision.shot import Shot
from sightray.vision.trajectory import Orbit
from sightray.vision.writers.base import known_writers

os.environ.setdefault("OPENCV_IO_ENABLE_OPENEXR", "1")
pytestmark = pytest.mark.peers
BIAS = 0.01  # pixels


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_shots(example_shots(), tmp_path_factory.mktemp("data"), *sorted(known_writers()))


LENSES = {
    "radial": {"k1": -0.25, "k2": 0.06, "p1": 0.001, "p2": -0.002},
    "rational": {"k1": -0.2, "k2": 0.05, "k3": 0.004, "k4": 0.02, "k5": 0.001, "p1": 0.001},
    "fisheye": {"model": "kannala_brandt", "k1": 0.02, "k2": -0.004, "k3": 0.001, "k4": -0.0002},
}


def lens_shot(name: str) -> Shot:
    """A picture by a distorting lens, its principal point off the middle."""
    pose = sr.Transform(Orbit((0, 0.3, 0), 2.0, elevation=15).pose(0))
    camera = sr.CalibratedCamera(
        fx=60, fy=61, cx=33.25, cy=22.75, width=WIDTH, height=HEIGHT, pose=pose, **LENSES[name]
    )
    scene = sr.Scene(block(0.7, 0.7, 0.7), sr.Plane(point=(0, 0, 0), normal=(0, 1, 0)), sr.PointLight(position=(2, 4, 3)),
                     camera=camera)  # fmt: skip
    return Shot(sr.label(scene, "position", "depth", "instance"))


def centres(shot: Shot) -> tuple[np.ndarray, np.ndarray]:
    """Points that are seen at pixel centres, and these, the top-left at (0.5, 0.5)."""
    rows, columns = np.nonzero(np.isfinite(shot.labels.position).all(axis=-1) & (shot.labels.depth < 20))
    return shot.labels.position[rows, columns], np.stack([columns, rows], axis=1) + 0.5


def bias(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.abs(found - truth).max())


# -------------------------------------------------------------------------------------------- transforms.json and COLMAP

NUMBER = {"type": "number"}
SCHEMA = {
    "type": "object", "required": ["camera_model", "frames"],
    "properties": {"frames": {"type": "array", "minItems": 1, "items": {
        "type": "object",
        "required": ["file_path", "transform_matrix", "fl_x", "fl_y", "cx", "cy", "w", "h", "camera_model"],
        "properties": {
            "file_path": {"type": "string"}, "fl_x": NUMBER, "fl_y": NUMBER, "cx": NUMBER, "cy": NUMBER,
            "w": {"type": "integer"}, "h": {"type": "integer"}, "k1": NUMBER, "k2": NUMBER, "p1": NUMBER, "p2": NUMBER,
            "camera_model": {"enum": ["PINHOLE", "OPENCV", "OPENCV_FISHEYE"]},
            "transform_matrix": {"type": "array", "minItems": 4, "maxItems": 4,
                                 "items": {"type": "array", "minItems": 4, "maxItems": 4, "items": NUMBER}},
        }}}},
}  # fmt: skip


@pytest.mark.parametrize("lens", ["radial", "fisheye"])
def test_transforms_reproject_through_pycolmap_and_pytransform3d(tmp_path, lens):
    jsonschema, pycolmap = import_module("jsonschema"), import_module("pycolmap")
    rotations = import_module("pytransform3d.rotations")
    transformations = import_module("pytransform3d.transformations")
    shot = lens_shot(lens)
    data = json.loads((write_shots([shot], tmp_path, "transforms") / "transforms/transforms.json").read_text())
    jsonschema.validate(data, SCHEMA)
    frame = data["frames"][0]
    names = {"OPENCV": ("k1", "k2", "p1", "p2"), "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4")}[frame["camera_model"]]
    camera = pycolmap.Camera(
        model=frame["camera_model"], width=frame["w"], height=frame["h"],
        params=[frame[n] for n in ("fl_x", "fl_y", "cx", "cy")] + [frame.get(n, 0.0) for n in names],
    )  # fmt: skip
    world_from_opengl = transformations.check_transform(np.array(frame["transform_matrix"]))
    half_turn = transformations.transform_from(rotations.active_matrix_from_angle(0, np.pi), np.zeros(3))
    camera_from_world = transformations.invert_transform(transformations.concat(half_turn, world_from_opengl))
    points, truth = centres(shot)
    there = transformations.transform(camera_from_world, transformations.vectors_to_points(points))[:, :3]
    assert bias(np.array([camera.img_from_cam(p) for p in there]), truth) <= BIAS


@pytest.mark.parametrize("form", ["txt", "bin"])
def test_pycolmap_reads_both_forms_and_reprojects(written, form):
    pycolmap = import_module("pycolmap")
    model = pycolmap.Reconstruction()
    (model.read_text if form == "txt" else model.read_binary)(str(written / "colmap/sparse/0"))
    assert (model.num_images(), model.num_cameras()) == (6, 1)
    assert model.num_points3D() > 1500
    errors = []
    for image in model.images.values():
        shot = next(s for s in example_shots() if f"{s.id:06}.png" == image.name)
        pose = image.cam_from_world() if callable(image.cam_from_world) else image.cam_from_world
        np.testing.assert_allclose(pose.matrix(), shot.labels.camera_from_world[:3], atol=1e-12)
        points, truth = centres(shot)
        camera = model.cameras[image.camera_id]
        errors.append(bias(np.array([camera.img_from_cam(pose * p) for p in points]), truth))
        for point in image.points2D:
            seen = camera.img_from_cam(pose * model.points3D[point.point3D_id].xyz)
            errors.append(bias(seen, point.xy))
    assert max(errors) <= BIAS


@pytest.mark.parametrize("lens", list(LENSES))
def test_pycolmap_knows_the_lenses(tmp_path, lens):
    pycolmap = import_module("pycolmap")
    shot = lens_shot(lens)
    model = pycolmap.Reconstruction(str(write_shots([shot], tmp_path, "colmap") / "colmap/sparse/0"))
    image, camera = model.images[1], model.cameras[1]
    assert camera.model.name == {"radial": "OPENCV", "rational": "FULL_OPENCV", "fisheye": "OPENCV_FISHEYE"}[lens]
    points, truth = centres(shot)
    pose = image.cam_from_world() if callable(image.cam_from_world) else image.cam_from_world
    assert bias(np.array([camera.img_from_cam(pose * p) for p in points]), truth) <= BIAS


# ------------------------------------------------------------------------------------------------------ KITTI, TUM, EuRoC


def test_opencv_reads_kitti_flow_and_disparity(written):
    cv2 = import_module("cv2")
    folder = written / "kitti/sequences/00"
    for shot in example_shots()[::2]:
        bgr = cv2.imread(str(folder / f"flow_occ/{shot.step:06}.png"), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
        assert bgr.dtype == np.uint16
        flow, valid = (bgr[..., 2:0:-1].astype(float) - 2**15) / 64, bgr[..., 0] == 1
        assert np.abs(flow - shot.labels.flow)[valid].max() <= 0.5 / 64 + 1e-12
        codes = cv2.imread(str(folder / f"disp_occ_0/{shot.step:06}.png"), cv2.IMREAD_UNCHANGED)
        assert codes.dtype == np.uint16
        assert np.abs(codes / 256 - shot.labels.disparity)[codes > 0].max() <= 0.5 / 256 + 1e-12
        picture = cv2.imread(str(folder / f"image_2/{shot.step:06}.png"))[..., ::-1]
        assert (picture == shot.image.to_bytes()).all()


def test_pykitti_reads_the_odometry_layout(written):
    """Its poses, times, pictures, intrinsics and baseline; it wants a laser, too, whose x is forward."""
    data = import_module("pykitti").odometry(str(written / "kitti"), "00")
    assert len(data) == 3
    truth = np.array([shot.labels.world_from_camera for shot in example_shots()[::2]])
    np.testing.assert_allclose(truth[0] @ np.array(data.poses), truth, atol=1e-12)
    np.testing.assert_allclose([stamp.total_seconds() for stamp in data.timestamps], [0, 0.1, 0.2], atol=1e-9)
    np.testing.assert_allclose(data.calib.K_cam2, K - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]], atol=1e-12)
    assert abs(data.calib.b_rgb - 0.1) <= 1e-9
    np.testing.assert_allclose(data.calib.T_cam2_velo @ [1, 2, 3, 1], [-2, -3, 1, 1], atol=1e-12)
    for step in range(3):
        for shot, picture in zip(example_shots()[2 * step :], data.get_rgb(step), strict=False):
            assert (np.asarray(picture) == shot.image.to_bytes()).all()


def test_opencv_reads_kitti_2015(written):
    cv2 = import_module("cv2")
    folder, labels = written / "kitti2015/training", example_shots()[0].labels
    for path in sorted((folder / "flow_occ").glob("*_10.png")):
        assert (folder / f"image_2/{path.name.replace('_10', '_11')}").is_file()
    bgr = cv2.imread(str(folder / "flow_occ/000000_10.png"), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    flow, valid = (bgr[..., 2:0:-1].astype(float) - 2**15) / 64, bgr[..., 0] == 1
    assert np.abs(flow - labels.flow)[valid].max() <= 0.5 / 64 + 1e-12
    codes = cv2.imread(str(folder / "disp_occ_0/000000_10.png"), cv2.IMREAD_UNCHANGED)
    assert codes.dtype == np.uint16
    assert np.abs(codes / 256 - labels.disparity)[codes > 0].max() <= 0.5 / 256 + 1e-12


def test_evo_reads_kitti_tum_and_euroc_poses(written):
    files = import_module("evo.tools.file_interface")
    truth = np.array([shot.labels.world_from_camera for shot in example_shots()[::2]])
    kitti = np.array(files.read_kitti_poses_file(str(written / "kitti/poses/00.txt")).poses_se3)
    np.testing.assert_allclose(truth[0] @ kitti, truth, atol=1e-12)
    tum = files.read_tum_trajectory_file(str(written / "tum/sequence_0000_left/groundtruth.txt"))
    np.testing.assert_allclose(np.array(tum.poses_se3), truth, atol=1e-12)
    np.testing.assert_allclose(tum.timestamps, [0, 0.1, 0.2], atol=1e-9)
    path = written / "euroc/sequence_0000/mav0/state_groundtruth_estimate0/data.csv"
    euroc = files.read_euroc_csv_trajectory(str(path))
    np.testing.assert_allclose(np.array(euroc.poses_se3), truth, atol=1e-12)
    np.testing.assert_allclose(euroc.timestamps, [0, 0.1, 0.2], atol=1e-9)


def test_opencv_reprojects_what_kitti_tum_and_euroc_say(written, tmp_path):
    """OpenCV has the centre of the top-left pixel at (0, 0): its pixels are ours less 0.5."""
    cv2 = import_module("cv2")
    shot = example_shots()[0]
    points, truth = centres(shot)
    r, t = cv2.Rodrigues(shot.labels.camera_from_world[:3, :3])[0], shot.labels.camera_from_world[:3, 3]
    lines = dict(line.split(":") for line in (written / "kitti/sequences/00/calib.txt").read_text().splitlines())
    k = np.array(lines["P2"].split(), float).reshape(3, 4)[:, :3]
    assert bias(cv2.projectPoints(points, r, t, k, None)[0][:, 0] + 0.5, truth) <= BIAS

    for lens in ("radial", "fisheye"):
        shot = lens_shot(lens)
        points, truth = centres(shot)
        r, t = cv2.Rodrigues(shot.labels.camera_from_world[:3, :3])[0], shot.labels.camera_from_world[:3, 3]
        root = write_shots([shot], tmp_path / lens, "euroc", *(["tum"] if lens == "radial" else []))
        sensor = yaml.safe_load((root / "euroc/sequence_0000/mav0/cam0/sensor.yaml").read_text())
        fu, fv, cu, cv = sensor["intrinsics"]
        k, d = np.array([[fu, 0, cu], [0, fv, cv], [0, 0, 1]]), np.array(sensor["distortion_coefficients"])
        if lens == "fisheye":
            assert sensor["distortion_model"] == "equidistant"
            found = cv2.fisheye.projectPoints(points[:, None], r, t, k, d)[0][:, 0]
            assert bias(found + 0.5, truth) <= BIAS
        else:
            assert sensor["distortion_model"] == "radial-tangential"
            assert bias(cv2.projectPoints(points, r, t, k, d)[0][:, 0] + 0.5, truth) <= BIAS
            numbers = np.array((root / "tum/sequence_0000/calibration.txt").read_text().split(), float)
            k = np.array([[numbers[0], 0, numbers[2]], [0, numbers[1], numbers[3]], [0, 0, 1]])
            assert bias(cv2.projectPoints(points, r, t, k, numbers[4:])[0][:, 0] + 0.5, truth) <= BIAS


def test_opencv_reads_tum_depth(written):
    cv2 = import_module("cv2")
    for shot in example_shots()[::2]:
        path = written / f"tum/sequence_0000_left/depth/{shot.time:.6f}.png"
        codes = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert codes.dtype == np.uint16
        assert np.abs(codes / 5000 - shot.labels.depth)[codes > 0].max() <= 0.5 / 5000 + 1e-12


# ------------------------------------------------------------------------------------------------------------------ BOP

MATRIX = {"type": "array", "items": NUMBER, "minItems": 9, "maxItems": 9}
VECTOR = {"type": "array", "items": NUMBER, "minItems": 3, "maxItems": 3}
BOX = {"type": "array", "items": {"type": "integer"}, "minItems": 4, "maxItems": 4}


def record(**properties):
    return {"type": "object", "required": list(properties), "properties": properties, "additionalProperties": False}


def by_image(items):
    return {"type": "object", "patternProperties": {"^[0-9]+$": items}, "additionalProperties": False}


def several(items):
    return {"type": "array", "items": items}


COUNT = {"type": "integer", "minimum": 0}
BOP = {
    "scene_camera": by_image(record(cam_K=MATRIX, depth_scale=NUMBER, cam_R_w2c=MATRIX, cam_t_w2c=VECTOR)),
    "scene_gt": by_image(several(record(cam_R_m2c=MATRIX, cam_t_m2c=VECTOR, obj_id={"type": "integer", "minimum": 1}))),
    "scene_gt_info": by_image(several(record(
        bbox_obj=BOX, bbox_visib=BOX, px_count_all=COUNT, px_count_valid=COUNT, px_count_visib=COUNT,
        visib_fract={"type": "number", "minimum": 0, "maximum": 1}))),
}  # fmt: skip


def test_bop_by_schema_trimesh_and_opencv(written):
    """Models placed by the ground truth and drawn by OpenCV's camera cover the object's mask."""
    cv2, jsonschema, trimesh = (import_module(name) for name in ("cv2", "jsonschema", "trimesh"))
    folder = written / "bop/train_pbr/000000"
    files = {name: json.loads((folder / f"{name}.json").read_text()) for name in BOP}
    for name, schema in BOP.items():
        jsonschema.validate(files[name], schema)
    models = {k: trimesh.load(written / f"bop/models/obj_{k:06}.ply", process=False) for k in (1, 2)}
    for shot in example_shots():
        image = str(shot.place)
        camera = files["scene_camera"][image]
        k = np.reshape(camera["cam_K"], (3, 3))
        for thing, gt in zip(shot.objects, files["scene_gt"][image], strict=True):
            r, t = cv2.Rodrigues(np.reshape(gt["cam_R_m2c"], (3, 3)))[0], np.array(gt["cam_t_m2c"])
            mesh = models[gt["obj_id"]]
            rows, columns = np.nonzero(shot.labels.instance == thing.index)
            seen = shot.labels.position[rows, columns]
            m = np.eye(4)
            m[:3, :3], m[:3, 3] = cv2.Rodrigues(r)[0], t
            there = 1000 * (seen @ shot.labels.camera_from_world[:3, :3].T + shot.labels.camera_from_world[:3, 3])
            local = (there - t) @ m[:3, :3]
            if len(local):
                _, away, _ = trimesh.proximity.closest_point_naive(mesh, local)
                assert away.max() <= 1e-3  # millimetres: models are float32
                found = cv2.projectPoints(local, r, t, k, None)[0][:, 0] + 0.5
                assert bias(found, np.stack([columns, rows], axis=1) + 0.5) <= BIAS
        codes = cv2.imread(str(folder / f"depth/{shot.place:06}.png"), cv2.IMREAD_UNCHANGED)
        there = codes > 0
        assert np.abs(codes * camera["depth_scale"] - 1000 * shot.labels.depth)[there].max() <= 0.05 + 1e-9


# ----------------------------------------------------------------------------------------------------------------- COCO


def test_pycocotools_reads_masks_boxes_and_areas(written):
    coco = import_module("pycocotools.coco")
    masks = import_module("pycocotools.mask")
    data = coco.COCO(str(written / "coco/annotations/instances.json"))
    for shot in example_shots():
        instance = shot.labels.instance
        found = data.loadAnns(data.getAnnIds(imgIds=shot.id))
        assert len(found) == len({int(i) for i in np.unique(instance)} & {0, 1, 2})
        for one in found:
            mask = data.annToMask(one).astype(bool)
            assert (mask == (instance == instance[mask][0])).all()
            assert masks.area(one["segmentation"]) == one["area"]
            assert masks.toBbox(one["segmentation"]).tolist() == one["bbox"]


def test_run_length_text_is_that_of_pycocotools_bit_for_bit():
    masks = import_module("pycocotools.mask")
    random = np.random.default_rng(5)
    for height, width in ((1, 1), (7, 5), (48, 64), (480, 640)):
        for share in (0.0, 0.001, 0.5, 0.999, 1.0):
            mask = random.random((height, width)) < share
            theirs = masks.encode(np.asfortranarray(mask.astype(np.uint8)))
            assert run_text(run_lengths(mask)).encode() == theirs["counts"]


# --------------------------------------------------------------------------------------------- Middlebury, EXR and HDF5


def test_opencv_reads_flo_and_pfm(written):
    cv2 = import_module("cv2")
    folder = written / "middlebury/sequence_0000_left"
    for shot in example_shots()[::2]:
        flow = cv2.readOpticalFlow(str(folder / f"flow/{shot.step:06}.flo"))
        there = np.isfinite(shot.labels.flow).all(axis=-1)
        assert (flow[there] == shot.labels.flow[there].astype(np.float32)).all()
        disparity = cv2.imread(str(folder / f"disparity/{shot.step:06}.pfm"), cv2.IMREAD_UNCHANGED)
        assert (disparity == shot.labels.disparity.astype(np.float32)).all()


def test_openexr_and_opencv_read_layers(written):
    OpenEXR, cv2 = import_module("OpenEXR"), import_module("cv2")
    shot = example_shots()[2]
    path = str(written / f"exr/{shot.id:06}.exr")
    with OpenEXR.File(path, separate_channels=True) as file:
        channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    labels = shot.labels
    np.testing.assert_array_equal(channels["depth.Y"], labels.depth.astype(np.float32))
    for k, axis in enumerate("XYZ"):
        np.testing.assert_array_equal(channels[f"normal.{axis}"], labels.normal[..., k].astype(np.float32))
    assert channels["instance.Y"].dtype == np.uint32
    assert (channels["instance.Y"].astype(int) - 1 == labels.instance).all()
    picture = cv2.imread(path, cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(picture[..., 2::-1], shot.image.pixels)


def test_h5py_reads_everything_exactly(written):
    h5py = import_module("h5py")
    shot = example_shots()[3]
    with h5py.File(written / f"hdf5/{shot.id:06}.h5") as file:
        for name in ("depth", "normal", "instance", "semantic", "flow", "occlusion", "disparity"):
            np.testing.assert_array_equal(file[name][()], shot.labels[name])
        assert (file["colors"][()] == shot.image.to_bytes()).all()
        np.testing.assert_array_equal(file["camera/world_from_camera"][()], shot.labels.world_from_camera)
        np.testing.assert_allclose(file["camera/intrinsics"][()], K)
        about = json.loads(file["about"][()])
        assert file["depth"].attrs["unit"] == "m"
    assert (about["time"], [o["name"] for o in about["objects"]][:2]) == (0.1, ["block-0", "cube-0"])


def test_hdf5_files_are_the_same_each_time(tmp_path):
    import_module("h5py")
    data = []
    for k in range(2):
        root = write_shots(example_shots()[:1], tmp_path / str(k), "hdf5")
        data.append((root / "hdf5/000000.h5").read_bytes())
    assert data[0] == data[1]
