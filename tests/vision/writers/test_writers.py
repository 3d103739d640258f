"""Every format read back by a small reader that is written here from the format's facts; no extras are needed.

What readers of others say is in test_peers.py.
"""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import pytest
import yaml
from example_shots import HEIGHT, RATE, WIDTH, K, block, example_scene, example_shots, moving
from PIL import Image
from reading import read_png

import sightray as sr
from sightray.errors import SceneError
from sightray.vision.bodies import Form
from sightray.vision.marks import write_shots
from sightray.vision.rle import mask_of, run_lengths, run_text
from sightray.vision.shot import Shot
from sightray.vision.writers.base import as_writer, known_writers


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A dataset in all formats that need no extras."""
    return write_shots(example_shots(), tmp_path_factory.mktemp("data"), *sorted(set(known_writers()) - {"hdf5"}))


def shot_of(step: int, camera: int = 0) -> Shot:
    return example_shots()[2 * step + camera]


def test_every_writer_states_its_conventions():
    for label, cls in known_writers().items():
        doc = " ".join((cls.__doc__ or "").split())
        assert "(0.5, 0.5)" in doc or "(0, 0)" in doc, label
        assert cls.summary().startswith(("Poses", "One", *"ABCDEFGHIJKLMNOPQRSTUVWXYZ")), label
    assert sorted(known_writers()) == ["bop", "coco", "colmap", "euroc", "exr", "hdf5", "kitti", "kitti2015", "middlebury",
                                       "sensors", "transforms", "tum"]  # fmt: skip


def test_unknown_format_offers_the_nearest():
    with pytest.raises(SceneError, match="unknown format 'cocos'; did you mean 'coco'"):
        as_writer("cocos")


# ---------------------------------------------------------------------------------------------------- transforms.json


def test_transforms_are_opengl_cameras_whose_pixels_are_ours(written):
    data = json.loads((written / "transforms/transforms.json").read_text())
    assert len(data["frames"]) == 6
    for frame, shot in zip(data["frames"], example_shots(), strict=True):
        m = np.array(frame["transform_matrix"])
        np.testing.assert_allclose(m[:3, 3], shot.labels.camera.pose.matrix[:3, 3], atol=1e-14)
        # A point of a seen surface, through OpenGL's axes: y up, looking along -z.
        p = shot.labels.position[::7, ::7].reshape(-1, 3)
        rows, columns = (v.ravel() for v in np.mgrid[0:HEIGHT:7, 0:WIDTH:7])
        q = np.linalg.solve(m, np.c_[p, np.ones(len(p))].T)[:3]
        u = frame["fl_x"] * q[0] / -q[2] + frame["cx"]
        v = frame["fl_y"] * -q[1] / -q[2] + frame["cy"]
        seen = np.isfinite(p).all(axis=1)
        np.testing.assert_allclose(np.c_[u, v][seen], np.c_[columns, rows][seen] + 0.5, atol=1e-9)
        assert (frame["w"], frame["h"], frame["camera_model"]) == (WIDTH, HEIGHT, "PINHOLE")
        assert (written / "transforms" / frame["file_path"]).read_bytes() == shot.png


# ------------------------------------------------------------------------------------------------------------- COLMAP


def read_colmap_text(folder):
    """Cameras, pictures with their points, and points."""
    lines = {p: [r.split() for r in (folder / f"{p}.txt").read_text().splitlines() if not r.startswith("#")]
             for p in ("cameras", "images", "points3D")}  # fmt: skip
    cameras = {int(r[0]): (r[1], int(r[2]), int(r[3]), [float(v) for v in r[4:]]) for r in lines["cameras"]}
    images = {}
    for head, points in zip(lines["images"][::2], lines["images"][1::2], strict=True):
        images[int(head[0])] = ([float(v) for v in head[1:8]], int(head[8]), head[9],
                                np.array(points, float).reshape(-1, 3))  # fmt: skip
    points = {int(r[0]): ([float(v) for v in r[1:4]], [int(v) for v in r[4:7]], [int(v) for v in r[8:]])
              for r in lines["points3D"]}  # fmt: skip
    return cameras, images, points


def rotation(w, x, y, z):
    """By the action on vectors: v + 2 w (q x v) + 2 q x (q x v)."""
    q, e = np.array([x, y, z]), np.eye(3)
    return np.stack([v + 2 * w * np.cross(q, v) + 2 * np.cross(q, np.cross(q, v)) for v in e], axis=1)


def test_colmap_text_reprojects_its_points(written):
    cameras, images, points = read_colmap_text(written / "colmap/sparse/0")
    assert len(cameras) == 1
    assert cameras[1][:3] == ("PINHOLE", WIDTH, HEIGHT)
    assert len(images) == 6
    for number, (pose, camera, name, observed) in images.items():
        fx, fy, cx, cy = cameras[camera][3]
        r, t = rotation(*pose[:4]), np.array(pose[4:])
        xyz = np.array([points[int(k)][0] for k in observed[:, 2]])
        p = xyz @ r.T + t
        uv = np.stack([fx * p[:, 0] / p[:, 2] + cx, fy * p[:, 1] / p[:, 2] + cy], axis=1)
        np.testing.assert_allclose(uv, observed[:, :2], atol=1e-9)
        assert all(points[int(k)][2] == [number, i] for i, k in enumerate(observed[:, 2]))
        assert (written / "colmap/images" / name).exists()
        assert len(observed) > 250


def test_colmap_binary_says_what_the_text_says(written):
    folder = written / "colmap/sparse/0"
    cameras, images, points = read_colmap_text(folder)
    data = io.BytesIO((folder / "cameras.bin").read_bytes())
    (count,) = struct.unpack("<Q", data.read(8))
    found = {}
    for _ in range(count):
        number, model, w, h = struct.unpack("<iiQQ", data.read(24))
        found[number] = ({1: "PINHOLE"}[model], w, h, list(struct.unpack("<4d", data.read(32))))
    assert found == cameras
    assert not data.read()

    data = io.BytesIO((folder / "images.bin").read_bytes())
    (count,) = struct.unpack("<Q", data.read(8))
    assert count == len(images)
    for _ in range(count):
        number, *pose, camera = struct.unpack("<i7di", data.read(64))
        name = b""
        while (letter := data.read(1)) != b"\0":
            name += letter
        (n,) = struct.unpack("<Q", data.read(8))
        xy = np.array([struct.unpack("<ddq", data.read(24)) for _ in range(n)])
        assert (pose, camera, name.decode()) == images[number][:3]
        assert (xy == images[number][3]).all()
    assert not data.read()

    data = io.BytesIO((folder / "points3D.bin").read_bytes())
    (count,) = struct.unpack("<Q", data.read(8))
    assert count == len(points)
    for _ in range(count):
        number, x, y, z, r, g, b, error, n = struct.unpack("<Q3d3BdQ", data.read(51))
        track = list(struct.unpack("<ii", data.read(8)))
        assert ([x, y, z], [r, g, b], track) == points[number]
        assert (error, n) == (0.0, 1)
    assert not data.read()


# -------------------------------------------------------------------------------------------------------------- KITTI


def test_kitti_flow_and_disparity_are_within_half_a_step(written):
    folder, labels = written / "kitti/sequences/00", shot_of(1).labels
    codes = read_png((folder / "flow_occ/000001.png").read_bytes())
    valid = codes[..., 2] == 1
    assert (valid == np.isfinite(labels.flow).all(axis=-1)).all()
    assert np.abs((codes[valid, :2] - 2**15) / 64 - labels.flow[valid]).max() <= 0.5 / 64 + 1e-12
    seen = read_png((folder / "flow_noc/000001.png").read_bytes())[..., 2] == 1
    assert (seen == (valid & ~labels.occlusion & ~labels.out_of_view)).all()
    assert seen.sum() < valid.sum()
    codes = read_png((folder / "disp_occ_0/000001.png").read_bytes())[..., 0]
    there = labels.disparity > 0
    assert ((codes > 0) == there).all()
    assert np.abs(codes[there] / 256 - labels.disparity[there]).max() <= 0.5 / 256 + 1e-12


def test_kitti_codes_at_the_ends_of_their_range():
    from sightray.vision.writers.kitti import disparity_codes, flow_codes

    flow = np.array([[[-512.0, 511.984375], [512.0, 0.0], [np.nan, 0.0], [0.0, -512.01], [0.0, 0.0]]])
    codes = flow_codes(flow)[0].tolist()
    assert codes == [[0, 65535, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0], [32768, 32768, 1]]
    disparity = np.array([[0.0, 1e-6, 1.0, 255.996, 257.0, np.nan, -1.0]])
    assert disparity_codes(disparity)[0].tolist() == [0, 1, 256, 65535, 0, 0, 0]


def test_kitti_poses_and_projections(written):
    poses = np.loadtxt(written / "kitti/poses/00.txt").reshape(-1, 3, 4)
    first = shot_of(0).labels.world_from_camera
    for step, pose in enumerate(poses):
        np.testing.assert_allclose(first @ np.vstack([pose, [0, 0, 0, 1]]), shot_of(step).labels.world_from_camera,
                                   atol=1e-13)  # fmt: skip
    lines = dict(line.split(":") for line in (written / "kitti/sequences/00/calib.txt").read_text().splitlines())
    p2, p3 = (np.array(lines[k].split(), float).reshape(3, 4) for k in ("P2", "P3"))
    np.testing.assert_allclose(p2[:, :3], K - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(p3[:, 3], [-K[0, 0] * 0.1, 0, 0], atol=1e-9)  # -f B
    times = np.loadtxt(written / "kitti/sequences/00/times.txt")
    assert (times == np.arange(3) / RATE).all()


# ------------------------------------------------------------------------------------------------------ TUM and EuRoC


def test_tum_depth_and_poses(written):
    folder = written / "tum/sequence_0000_left"
    rows = np.loadtxt(folder / "groundtruth.txt")
    for step, row in enumerate(rows):
        labels = shot_of(step).labels
        np.testing.assert_allclose(row[1:4], labels.world_from_camera[:3, 3], atol=1e-14)
        np.testing.assert_allclose(rotation(row[7], *row[4:7]), labels.world_from_camera[:3, :3], atol=1e-14)
        name = (folder / "depth.txt").read_text().splitlines()[1 + step].split()[1]
        codes = read_png((folder / name).read_bytes())[..., 0]
        near = np.isfinite(labels.depth) & (labels.depth < 13.1)
        assert ((codes > 0) == near).all()
        assert np.abs(codes[near] / 5000 - labels.depth[near]).max() <= 0.5 / 5000 + 1e-12
    numbers = np.array((folder / "calibration.txt").read_text().split(), float)
    np.testing.assert_allclose(numbers, [70, 72, 32.75, 22, 0, 0, 0, 0, 0], atol=1e-12)


def test_euroc_states_and_sensors(written):
    folder = written / "euroc/sequence_0000/mav0"
    rows = np.loadtxt(folder / "state_groundtruth_estimate0/data.csv", delimiter=",")
    assert rows.shape == (3, 17)
    for step, row in enumerate(rows):
        pose = shot_of(step).labels.world_from_camera
        assert row[0] == step * 100_000_000
        np.testing.assert_allclose(row[1:4], pose[:3, 3], atol=1e-14)
        np.testing.assert_allclose(rotation(*row[4:8]), pose[:3, :3], atol=1e-14)
        np.testing.assert_allclose(row[8:11], moving(example_scene()).camera.velocity(step / RATE), atol=1e-7)
    assert (rows[:, 11:] == 0).all()
    right = yaml.safe_load((folder / "cam1/sensor.yaml").read_text())
    np.testing.assert_allclose(np.reshape(right["T_BS"]["data"], (4, 4))[:3, 3], [0.1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(right["intrinsics"], [70, 72, 32.75, 22], atol=1e-12)
    assert (folder / "cam1/data/100000000.png").read_bytes() == shot_of(1, 1).png


# ---------------------------------------------------------------------------------------------------------------- BOP


def test_bop_poses_project_vertices_where_they_are_seen(written):
    folder = written / "bop/train_pbr/000000"
    cameras, gts = (json.loads((folder / f"scene_{k}.json").read_text()) for k in ("camera", "gt"))
    for shot in example_shots():
        camera, gt = cameras[str(shot.place)], gts[str(shot.place)]
        assert [g["obj_id"] for g in gt] == [1, 2, 1]
        k, r, t = (np.array(camera[n]) for n in ("cam_K", "cam_R_w2c", "cam_t_w2c"))
        for thing, pose in zip(shot.objects, gt, strict=True):
            mesh = ply_vertices(written / f"bop/models/obj_{pose['obj_id']:06}.ply")
            p = mesh @ np.reshape(pose["cam_R_m2c"], (3, 3)).T + pose["cam_t_m2c"]
            world = (p - t) @ np.reshape(r, (3, 3)) / 1000
            uv = p @ k.reshape(3, 3).T
            np.testing.assert_allclose(uv[:, :2] / uv[:, 2:] + 0.5, shot.labels.camera.project(world), atol=1e-6)
            placed = thing.world_from_object
            original = shot.scene.objects[thing.index]
            while isinstance(original, sr.Instance):
                original = original.of
            np.testing.assert_allclose(world, original.vertices @ placed[:3, :3].T + placed[:3, 3], atol=1e-6)


def ply_vertices(path) -> np.ndarray:
    data = path.read_bytes()
    head, _, body = data.partition(b"end_header\n")
    n = int(head.split(b"element vertex ")[1].split()[0])
    return np.frombuffer(body, "<f4", 3 * n).reshape(n, 3).astype(float)


def test_bop_masks_boxes_and_counts(written):
    folder = written / "bop/train_pbr/000000"
    infos = json.loads((folder / "scene_gt_info.json").read_text())
    hidden = outside = 0
    for shot in example_shots():
        labels = shot.labels
        amodal = sr.label(shot.scene, "amodal_masks", camera=labels.camera).amodal_masks
        wide = labels.camera.replace(width=3 * WIDTH, height=3 * HEIGHT, cx=K[0, 2] + WIDTH, cy=K[1, 2] + HEIGHT)
        large = sr.label(shot.scene, "amodal_masks", camera=wide).amodal_masks
        for k, info in enumerate(infos[str(shot.place)]):
            visible = np.array(Image.open(folder / f"mask_visib/{shot.place:06}_{k:06}.png")) == 255
            whole = np.array(Image.open(folder / f"mask/{shot.place:06}_{k:06}.png")) == 255
            assert (visible == (labels.instance == k)).all()
            assert (whole == amodal[k]).all()
            assert info["px_count_all"] == large[k].sum()
            assert info["px_count_visib"] == visible.sum()
            assert info["px_count_valid"] == whole.sum()
            rows, columns = np.nonzero(large[k])
            box = [columns.min() - WIDTH, rows.min() - HEIGHT, np.ptp(columns), np.ptp(rows)]
            assert info["bbox_obj"] == (box if visible.any() else [-1] * 4)
            hidden += visible.sum() < whole.sum()
            outside += whole.sum() < info["px_count_all"]
        codes = read_png((folder / f"depth/{shot.place:06}.png").read_bytes())[..., 0]
        near = labels.depth < 6.55
        assert np.abs(codes[near] * 0.1 - 1000 * labels.depth[near]).max() <= 0.05 + 1e-9
    assert hidden > 0
    assert outside > 0


def test_bop_models(written):
    info = json.loads((written / "bop/models/models_info.json").read_text())
    np.testing.assert_allclose(info["1"]["diameter"], 1000 * np.sqrt(0.6**2 + 0.8**2 + 0.4**2), rtol=1e-12)
    assert (info["2"]["size_x"], info["2"]["min_y"]) == (500.0, 0.0)


def test_bop_refuses_what_is_not_rigid_or_no_mesh():
    scene = example_scene()
    ball = Shot(sr.label(scene, "depth", "instance"), targets=(3,))
    with pytest.raises(SceneError, match="bop: object 'ball': got a Sphere; allowed: meshes"):
        as_writer("bop").accept(ball)
    large = scene.replace(objects=(block(1, 1, 1).replace(transform=sr.Transform.scale(2)), *scene.objects[3:]))
    with pytest.raises(SceneError, match="its transform is not rigid"):
        as_writer("bop").accept(Shot(sr.label(large, "depth", "instance"), targets=(0,)))


def test_diameter_is_the_farthest_pair():
    random = np.random.default_rng(3)
    for scale in ((1, 1, 1), (5, 1, 0.1)):
        points = random.normal(size=(500, 3)) * scale
        faces = random.permutation(500)[:498].reshape(-1, 3)
        used = points[faces.ravel()]
        truth = np.linalg.norm(used[:, None] - used[None], axis=-1).max()
        assert abs(Form(points, faces).diameter - truth) <= 1e-12 * truth


# --------------------------------------------------------------------------------------------------------------- COCO


def test_run_lengths_and_their_text():
    mask = np.array([[0, 1, 1], [0, 1, 0]], bool)
    assert run_lengths(mask) == [2, 3, 1]
    assert run_lengths(np.ones((2, 2), bool)) == [0, 4]
    assert run_lengths(np.zeros((2, 2), bool)) == [4]
    random = np.random.default_rng(1)
    for share in (0.01, 0.5, 0.99):
        mask = random.random((37, 53)) < share
        runs = run_lengths(mask)
        assert (mask_of(runs, 37, 53) == mask).all()
        assert text_runs(run_text(runs)) == runs


def text_runs(text: str) -> list[int]:
    """The inverse of COCO's text, from its description."""
    runs, at = [], 0
    while at < len(text):
        value, shift, more = 0, 0, True
        while more:
            code = ord(text[at]) - 48
            value |= (code & 31) << shift
            more, at, shift = bool(code & 32), at + 1, shift + 5
        if code & 16:
            value -= 1 << shift
        runs.append(value + (runs[-2] if len(runs) > 2 else 0))
    return runs


def test_coco_instances_and_panoptic(written):
    data = json.loads((written / "coco/annotations/instances.json").read_text())
    names = {c["id"]: c["name"] for c in data["categories"]}
    assert list(names.values()) == ["block", "cube"]
    by_image: dict[int, list] = {}
    for one in data["annotations"]:
        by_image.setdefault(one["image_id"], []).append(one)
    panoptic = json.loads((written / "coco/annotations/panoptic.json").read_text())
    kinds = {c["id"]: (c["name"], c["isthing"]) for c in panoptic["categories"]}
    assert sorted(kinds.values()) == [("ball", 0), ("block", 1), ("cube", 1), ("floor", 0)]
    for shot, picture in zip(example_shots(), panoptic["annotations"], strict=True):
        instance = shot.labels.instance
        for one in by_image[shot.id]:
            mask = mask_of(text_runs(one["segmentation"]["counts"]), HEIGHT, WIDTH)
            index = int(instance[mask][0])
            assert (mask == (instance == index)).all()
            assert one["area"] == mask.sum()
            rows, columns = np.nonzero(mask)
            assert one["bbox"] == [columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1]
            assert names[one["category_id"]] == ("cube" if index == 1 else "block")
        pixels = np.array(Image.open(written / "coco/panoptic" / picture["file_name"])).astype(int)
        ids = pixels @ [1, 256, 65536]
        assert (ids == instance + 1).all()
        assert {s["id"] for s in picture["segments_info"]} == set(np.unique(ids)) - {0}
        for segment in picture["segments_info"]:
            assert segment["area"] == (ids == segment["id"]).sum()


# --------------------------------------------------------------------------------------------- Middlebury, EXR and HDF5


def test_middlebury_files_byte_by_byte(written):
    folder, labels = written / "middlebury/sequence_0000_left", shot_of(1).labels
    data = (folder / "flow/000001.flo").read_bytes()
    assert struct.unpack("<fii", data[:12]) == (202021.25, WIDTH, HEIGHT)
    flow = np.frombuffer(data, "<f4", offset=12).reshape(HEIGHT, WIDTH, 2)
    there = np.isfinite(labels.flow).all(axis=-1)
    assert (flow[there] == labels.flow[there].astype(np.float32)).all()
    assert (flow[~there] > 1e9).all()
    head, size, scale, body = (folder / "disparity/000001.pfm").read_bytes().split(b"\n", 3)
    assert (head, size, float(scale)) == (b"Pf", f"{WIDTH} {HEIGHT}".encode(), -1.0)
    disparity = np.frombuffer(body, "<f4").reshape(HEIGHT, WIDTH)[::-1]
    assert (disparity == labels.disparity.astype(np.float32)).all()
    calib = dict(line.split("=") for line in (folder / "calib.txt").read_text().splitlines())
    depth = float(calib["baseline"]) * K[0, 0] / (disparity + float(calib["doffs"])) / 1000
    near = np.isfinite(labels.depth)
    np.testing.assert_allclose(depth[near], labels.depth[near], rtol=1e-5)
    assert calib["cam0"] == "[70.0 0.0 32.75; 0.0 72.0 22.0; 0.0 0.0 1.0]"


def test_exr_layers_are_exact(written):
    from sightray.images.exr import read_layers

    shot = shot_of(2)
    layers = read_layers(written / f"exr/{shot.id:06}.exr")
    labels = shot.labels
    np.testing.assert_array_equal(layers["depth"][..., 0], labels.depth.astype(np.float32))
    np.testing.assert_array_equal(layers["normal"], labels.normal.astype(np.float32))
    np.testing.assert_array_equal(layers["flow"], labels.flow.astype(np.float32))
    assert layers["instance"].dtype == np.uint32
    assert (layers["instance"][..., 0].astype(int) - 1 == labels.instance).all()
    assert (layers[""] == shot.image.pixels).all()


def test_pictures_without_flow_or_disparity_are_no_middlebury():
    shot = Shot(sr.label(example_scene(), "depth"))
    with pytest.raises(SceneError, match="middlebury: neither flow nor disparity"):
        as_writer("middlebury").accept(shot)


@pytest.mark.parametrize("label", ["bop", "kitti", "kitti2015", "tum", "euroc", "colmap", "transforms"])
def test_cameras_that_a_format_cannot_state_are_refused(label):
    labels = sr.label(
        example_scene(), "depth", "instance", camera=sr.PanoramaCamera(eye=(0, 1, 3), width=32, height=16)
    )
    with pytest.raises(SceneError, match=f"{label}: camera: got a PanoramaCamera; allowed: pinholes"):
        as_writer(label).accept(Shot(labels, targets=()))
