"""Labels as people use them: options and their errors, pictures, files, and the command."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from label_scenes import BALL, FLOOR, centres, every_camera, moved, scene

import sightray as sr
from sightray.images.exr import read_layers
from sightray.vision.label import known_layers

CAMERA = every_camera()["PinholeCamera"].resized(96, 64)
POINTS = {"ball": [(0.2, 1.4, 0.3), (0.2, 0.6, -0.5), (0.2, 0.6, 1.1), (0.2, 50, 0.3), (0.4, 1.6, 9.0)]}


def everything():
    """Every layer at once."""
    room = scene(
        CAMERA,
        *moved(CAMERA, 0).objects,
        sr.PointLight(position=(2, 4, 3), intensity=30),
        ambient=0.3,
        background=(0.2, 0.3, 0.5),
    )
    lit = moved(CAMERA).objects + room.lights
    stereo = CAMERA.replace(pose=CAMERA.pose @ sr.Transform.translate(0.1, 0, 0))
    return sr.label(room, *known_layers(), next=scene(CAMERA, *lit), previous=room, stereo=stereo, keypoints=POINTS)


@pytest.fixture(scope="module")
def labels():
    return everything()


def test_every_layer_is_there_under_its_name(labels):
    assert set(labels.layers) == set(known_layers())
    for name in labels.layers:
        assert labels[name] is getattr(labels, name)
        layer = labels.about(name)
        values = labels[name]
        if layer.letters:
            assert values.shape[:2] == (labels.height, labels.width)
            assert values.shape[2:] == ((layer.columns,) if layer.columns > 1 else ())
            assert len(layer.letters) == layer.columns
        if layer.letters and "instance" in labels and name not in ("disparity",):
            nothing = labels.instance < 0
            if layer.dtype is np.int32:
                assert values.dtype == np.int32
            if layer.unit == "m" and layer.columns == 1:
                assert (values[nothing] == layer.background).all(), name


def test_every_picture_has_the_size_of_the_labels_and_a_legend_below(labels):
    for name in labels.layers:
        if labels.about(name).picture:
            plain, full = labels.picture(name, legend=False), labels.picture(name)
            assert (plain.width, plain.height) == (labels.width, labels.height), name
            assert full.height > plain.height, name
            assert (np.asarray(full)[: plain.height] == np.asarray(plain)).all(), name
            even = ("glass", "mirror", "emitter", "backward_occlusion", "ray_origin")
            assert np.asarray(plain).std() > 1e-3 or name in even, name
            assert np.isfinite(np.asarray(full)).all(), name


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (8, 6), (20, 1)])
def test_tiny_pictures_have_legends_too(size):
    camera = sr.PerspectiveCamera(width=size[0], height=size[1])
    names = ("depth", "normal", "instance", "position", "uv", "flow", "visible_boxes", "mirror", "surfaces", "coverage")
    labels = sr.label(sr.Scene(BALL, camera=camera), *names, next=camera)
    for name in names:
        picture = labels.picture(name)
        assert picture.width == size[0]
        assert picture.height > size[1]


def test_what_is_no_picture_says_so(labels, monkeypatch):
    monkeypatch.setattr(type(labels.about("depth")), "picture", "")
    with pytest.raises(sr.SceneError, match="layer 'depth' is no picture"):
        labels.picture("depth")
    with pytest.raises(KeyError, match="did you mean 'depth'"):
        labels.picture("dpeth")
    with pytest.raises(AttributeError, match="did you mean 'depth'"):
        labels.dpeth  # noqa: B018


def test_files_hold_what_the_labels_hold(labels, tmp_path):
    folder = labels.save(tmp_path / "new" / "folder")
    about = json.loads((folder / "labels.json").read_text())
    assert not [p for p in folder.iterdir() if p.name.startswith(".")]
    for name in labels.layers:
        values = labels[name]
        if isinstance(values, np.ndarray):
            stored = np.load(folder / f"{name}.npy")
            assert stored.dtype == values.dtype, name
            assert stored.tobytes() == values.tobytes(), name
        elif isinstance(values, dict):
            for key, rows in values.items():
                np.testing.assert_array_equal(np.array(about["layers"][name]["value"][key], float), rows)
        else:
            with np.load(folder / f"{name}.npz") as arrays:
                for key, rows in values._asdict().items():
                    np.testing.assert_array_equal(arrays[key], rows)
        assert about["layers"][name]["doc"] == labels.about(name).summary()
        assert (folder / f"{name}.png").exists() == bool(labels.about(name).picture)
    layers = read_layers(folder / "layers.exr")
    np.testing.assert_array_equal(layers["depth"][..., 0], labels.depth.astype(np.float32))
    np.testing.assert_array_equal(layers["instance"][..., 0], labels.instance + 1)
    np.testing.assert_array_equal(layers["brightness_constancy"][..., 0], labels.brightness_constancy)
    np.testing.assert_array_equal(layers["occlusion"][..., 0], labels.occlusion)
    np.testing.assert_array_equal(layers["normal"], labels.normal.astype(np.float32))
    np.testing.assert_array_equal(layers["flow"], labels.flow.astype(np.float32))
    np.testing.assert_allclose(about["camera"]["intrinsics"], CAMERA.intrinsics())
    np.testing.assert_allclose(about["camera"]["world_from_camera"], CAMERA.pose.matrix)
    assert [o["name"] for o in about["objects"]] == ["ball", "floor", "ring", "egg", "crate"]
    assert about["objects"][1]["upper"] == [None, None, None]


# --------------------------------------------------------------------------------------- classes, poses, boxes, keypoints


def test_classes_are_names_kinds_or_what_is_said():
    things = (BALL, FLOOR.replace(name=""), BALL.replace(center=(9, 0, 0), name="other ball"))
    plain = sr.label(scene(CAMERA, *things), "semantic", "instance")
    assert plain.classes == ("ball", "Plane", "other ball")
    assert (plain.semantic == plain.instance).all()
    named = sr.label(scene(CAMERA, *things), "semantic", "instance", classes={"other ball": "sphere", "ball": "sphere"})
    assert named.classes == ("sphere", "Plane")
    assert [o.category for o in named.objects] == ["sphere", "Plane", "sphere"]
    assert (named.semantic == np.array([0, 1, 0, -1])[named.instance]).all()
    listed = sr.label(scene(CAMERA, *things), "semantic", "instance", classes=["wall", "Plane", "ball"])
    assert listed.classes == ("wall", "Plane", "ball", "other ball")
    assert (listed.semantic == np.array([2, 1, 3, -1])[listed.instance]).all()


def test_groups_are_one_instance_with_one_pose_and_parts_have_materials():
    red, blue = sr.Lambert(albedo=(1, 0, 0)), sr.Lambert(albedo=(0, 0, 1))
    parts = sr.Sphere(radius=0.5, material=red), sr.Sphere(center=(0.7, 0, 0), radius=0.4, material=blue)
    pose = sr.Transform.translate(0, 0.5, 0.2) @ sr.Transform.rotate((0, 1, 0), 50)
    group = sr.Group(objects=parts, transform=pose, name="snowman")
    again = sr.Instance(of=group, transform=sr.Transform.translate(0, 0, -1.5), name="second")
    labels = sr.label(
        scene(CAMERA, group, again), "instance", "material", "item", "poses", "boxes_3d", "object_position"
    )
    assert set(np.unique(labels.instance)) == {-1, 0, 1}
    assert set(np.unique(labels.item)) == {-1, 0, 1, 2, 3}
    assert labels.materials == (red, blue)
    assert (labels.material == np.array([0, 1, 0, 1, -1])[labels.item]).all()
    np.testing.assert_allclose(labels.objects[0].world_from_object, pose.matrix)
    moved_pose = sr.Transform.translate(0, 0, -1.5) @ pose
    np.testing.assert_allclose(
        labels.poses, [np.linalg.inv(CAMERA.pose.matrix) @ p.matrix for p in (pose, moved_pose)], atol=1e-14
    )
    np.testing.assert_allclose(labels.objects[0].lower, (-0.5, -0.5, -0.5))
    np.testing.assert_allclose(labels.objects[0].upper, (1.1, 0.5, 0.5))
    np.testing.assert_allclose(
        labels.boxes_3d[1], moved_pose.point([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 1.1)])
    )
    for index in (0, 1):
        p = labels.object_position[labels.instance == index]
        assert (p >= np.array(labels.objects[0].lower) - 1e-12).all()
        assert (p <= np.array(labels.objects[0].upper) + 1e-12).all()


def test_keypoints_and_their_visibility(labels):
    found = labels.keypoints["ball"]
    points = np.array(POINTS["ball"])
    expected = CAMERA.project(points)
    np.testing.assert_allclose(found[:, :2], expected, atol=1e-9)
    assert found[:, 2].tolist() == [2, 1, 2, 0, 0]  # top, back, front, above the picture, behind the camera
    assert np.isnan(found[4, :2]).all()


def test_correspondences_name_the_same_point_again(labels):
    there = labels.flow + centres(CAMERA)
    lost = labels.occlusion | labels.out_of_view
    np.testing.assert_array_equal(labels.correspondence, np.where(lost[..., None], np.nan, there))


# ---------------------------------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(("layers", "options", "message"), [
    (["dpeth"], {}, r"label: unknown layer 'dpeth'; did you mean 'depth'\? Allowed: .*albedo"),
    ([7], {}, "label: got 7; allowed: names of layers"),
    (["flow"], {}, "label: next: missing; give next="),
    (["backward_flow"], {}, "label: previous: missing"),
    (["disparity"], {}, "label: stereo: missing"),
    (["flow"], {"next": "soon"}, "label: next: got 'soon'; allowed: a Scene with a camera, a camera, or seconds"),
    (["flow"], {"next": sr.Scene(BALL)}, "label: next: got a scene without a camera"),
    (["depth"], {"camera": "left"}, "label: camera: got 'left'; allowed: a camera"),
    (["depth"], {"threads": 0}, "label: threads: got 0"),
    (["keypoints"], {}, "label: keypoints: missing"),
    (["keypoints"], {"keypoints": {"bal": [(0, 0, 0)]}}, "label: keypoints: unknown object 'bal'; did you mean 'ball'"),
    (["keypoints"], {"keypoints": {"ball": [(0, 0)]}}, r"'ball': got shape \(1, 2\); allowed: \(n, 3\)"),
    (["semantic"], {"classes": {"ball": 4}}, "label: classes: got 4"),
])  # fmt: skip
def test_errors_say_what_is_allowed(layers, options, message):
    with pytest.raises(sr.SceneError, match=message):
        sr.label(scene(CAMERA, BALL), *layers, **options)


def test_a_scene_without_a_camera_can_be_given_one():
    with pytest.raises(sr.SceneError, match=r"Scene\.camera: missing"):
        sr.label(sr.Scene(BALL), "depth")
    given = sr.label(sr.Scene(BALL), "depth", "albedo", camera=CAMERA)
    own = sr.label(scene(CAMERA, BALL), "depth", "albedo")
    assert given.depth.tobytes() == own.depth.tobytes()
    assert given.albedo.tobytes() == own.albedo.tobytes()


def test_a_folder_that_cannot_be_made_is_told_in_words(tmp_path):
    (tmp_path / "file").write_text("x")
    labels = sr.label(scene(CAMERA, BALL), "depth")
    with pytest.raises(sr.SceneError, match="no folder that can be written"):
        labels.save(tmp_path / "file" / "sub")


# --------------------------------------------------------------------------------------------------------------- command


def sightray(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "sightray", *map(str, arguments)], capture_output=True, text=True, timeout=300
    )


def test_the_command_writes_files(tmp_path):
    out = tmp_path / "labels"
    result = sightray("label", "whitted", "-o", out, "--layers", "depth,normal,visible_boxes", "--width", 64)
    assert result.returncode == 0, result.stderr
    assert f"{out}: 64x48, depth, normal, visible_boxes" in result.stdout
    assert np.load(out / "depth.npy").shape == (48, 64)
    assert {p.name for p in out.iterdir()} == {
        "depth.npy", "depth.png", "normal.npy", "normal.png", "visible_boxes.npy", "visible_boxes.png",
        "layers.exr", "labels.json",
    }  # fmt: skip
    assert "depth" in sightray("label", "whitted", "--layers", "list").stdout


@pytest.mark.parametrize(("arguments", "words"), [
    (["label", "whitted", "-o", "x", "--layers", "depht"], ["unknown layer 'depht'", "did you mean 'depth'"]),
    (["label", "whitted", "-o", "x", "--layers", "flow"], ["label: next: missing"]),
    (["label", "whitted"], ["--output"]),
])  # fmt: skip
def test_mistakes_at_the_command_line_are_one_line(arguments, words, tmp_path):
    result = subprocess.run(
        [sys.executable, "-m", "sightray", *arguments], capture_output=True, text=True, cwd=tmp_path, timeout=300
    )
    assert result.returncode == 2
    (line,) = result.stderr.strip().splitlines()
    for word in words:
        assert word in line


def test_masks_of_very_many_objects_are_refused():
    balls = [sr.Sphere(center=(k % 50, k // 50, 0), radius=0.3) for k in range(3000)]
    camera = sr.PerspectiveCamera(width=1600, height=1200)
    with pytest.raises(sr.SceneError, match="visible_masks: 3000 objects in 1600x1200 pixels take 5493 MiB; allowed"):
        sr.label(sr.Scene(*balls, camera=camera), "visible_masks")
