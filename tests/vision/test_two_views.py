"""E3 and E4: flow, occlusion, disparity and two-view geometry against projection written out, and by casting rays."""

from __future__ import annotations

import numpy as np
import pytest
from label_scenes import BALL, CRATE, EGG, FLOOR, RING, centres, every_camera, moved, scene

import sightray as sr
from sightray.scene.instance import moves
from sightray.vision.poses import object_pose

EVERY = [pytest.param(camera, id=name) for name, camera in every_camera().items()]
TURN = sr.Transform.translate(0.1, 0.05, -0.1) @ sr.Transform.rotate((0, 1, 0.2), 12)


def aside(camera, step=(0.15, -0.1, 0.05)):
    """The same camera a step aside, turned a little."""
    if "eye" in camera.given:
        eye, target = np.add(camera.eye, step), np.add(camera.target, (0.1, 0.05, 0))
        return camera.replace(eye=eye, target=target)
    turn = sr.Transform.translate(*step) @ sr.Transform.rotate((0.2, 1, 0), 2)
    if "poses" in camera.given:
        return camera.replace(poses=[(0.0, turn.matrix @ camera.world_from_camera())])
    return camera.replace(pose=turn @ camera.pose)


def carried(points, instance):
    """Where `moved` brings the points of `OBJECTS`, by matrices written out here."""
    there = points.copy()
    there[instance == 0] = points[instance == 0] + (0.1, 0, -0.2)
    there[instance == 2] = points[instance == 2] + (0, 0.1, 0)
    for k in (3, 4):
        there[instance == k] = points[instance == k] @ TURN.matrix[:3, :3].T + TURN.matrix[:3, 3]
    return there


@pytest.mark.parametrize("camera", EVERY)
def test_e3_flow_is_the_projection_of_the_moved_point(camera):
    after = moved(aside(camera))
    labels = sr.label(scene(camera), "flow", "position", "instance", "scene_flow", "next_position", next=after)
    met = labels.instance >= 0
    there = carried(labels.position, labels.instance)
    np.testing.assert_allclose(labels.next_position[met], there[met], atol=1e-12)
    np.testing.assert_allclose(labels.scene_flow[met], (there - labels.position)[met], atol=1e-12)
    with np.errstate(invalid="ignore"):
        expected = after.camera.project(there) - centres(camera)
    np.testing.assert_allclose(labels.flow[met], expected[met], atol=1e-9)
    assert np.isfinite(expected[met]).mean() > 0.9
    assert np.nanmax(np.abs(labels.flow[met])) > 1


def test_e3_flow_by_the_matrices_of_a_pinhole():
    """pi(T1 inv(T0) X) - x with K, R and t alone."""
    camera = every_camera()["PinholeCamera"]
    after = moved(aside(camera))
    labels = sr.label(scene(camera), "flow", "position", "instance", next=after)
    met = labels.instance >= 0
    inverse = np.linalg.inv(after.camera.pose.matrix)
    x = carried(labels.position[met], labels.instance[met]) @ inverse[:3, :3].T + inverse[:3, 3]
    h = x @ after.camera.intrinsics().T
    assert np.abs(labels.flow[met] - (h[:, :2] / h[:, 2:] - centres(camera)[met])).max() <= 1e-9


@pytest.mark.parametrize("camera", EVERY)
def test_e3_forward_and_backward_flow_are_inverse_where_both_see_the_point(camera):
    """The ray through the pixel that flow names meets the point; its own flow leads back."""
    before, after = scene(camera), moved(aside(camera))
    labels = sr.label(before, "correspondence", "next_position", "instance", next=after)
    both = np.isfinite(labels.correspondence[..., 0]) & (labels.instance >= 0)
    assert both.sum() > 400
    o, d = after.camera.rays(labels.correspondence[both])
    hits = after.intersect(o, d)
    assert (hits.shape == labels.instance[both]).mean() > 0.99  # at an outline rounding may choose the other side
    same = hits.shape == labels.instance[both]
    clear = same & (np.abs((hits.normal * d).sum(-1)) > 0.02)
    assert np.abs(hits.position - labels.next_position[both])[clear].max() <= 1e-10
    back = hits.position.copy()
    inverse = np.linalg.inv(TURN.matrix)
    back[hits.shape == 0] -= (0.1, 0, -0.2)
    back[hits.shape == 2] -= (0, 0.1, 0)
    turned = hits.shape >= 3
    back[turned] = hits.position[turned] @ inverse[:3, :3].T + inverse[:3, 3]
    with np.errstate(invalid="ignore"):
        assert np.abs(before.camera.project(back) - centres(camera)[both])[clear].max() <= 1e-9


def test_e3_backward_flow_is_the_flow_to_the_picture_before():
    camera = every_camera()["PerspectiveCamera"]
    after = moved(aside(camera))
    backward = sr.label(after, "backward_flow", "backward_occlusion", previous=scene(camera))
    forward = sr.label(after, "flow", "occlusion", next=scene(camera))
    np.testing.assert_array_equal(backward.backward_flow, forward.flow)
    np.testing.assert_array_equal(backward.backward_occlusion, forward.occlusion)


@pytest.mark.parametrize("name", ["PerspectiveCamera", "PinholeCamera"])
def test_e3_the_background_moves_by_the_infinite_homography(name):
    """K R inv(K) under a rotation about the eye, and also if the camera steps aside: it is infinitely far."""
    camera = every_camera()[name]
    nothing = sr.Sphere(center=(0, 0, 1000))
    turned = camera.replace(target=(0.5, 0.6, -0.3)) if name == "PerspectiveCamera" else camera.replace(
        pose=camera.pose @ sr.Transform.rotate((0.3, 1, 0.1), 7))  # fmt: skip
    for after in (turned, aside(turned)):
        labels = sr.label(scene(camera, nothing), "flow", "instance", next=after)
        assert (labels.instance < 0).all()
        k = camera.intrinsics()
        r = after.world_from_camera()[:3, :3].T @ camera.world_from_camera()[:3, :3]
        h = np.concatenate([centres(camera), np.ones((camera.height, camera.width, 1))], axis=-1)
        h = h @ (k @ r @ np.linalg.inv(k)).T
        assert np.abs(labels.flow - (h[..., :2] / h[..., 2:] - centres(camera))).max() <= 1e-9
        assert np.abs(labels.flow).max() > 3


@pytest.mark.parametrize("camera", EVERY)
def test_e3_the_background_is_infinitely_far_for_every_camera_with_an_eye(camera):
    if type(camera).__name__ == "OrthographicCamera":
        return  # all its rays go to the same point at infinity
    after = aside(camera)
    labels = sr.label(scene(camera, sr.Sphere(center=(0, 0, 1000))), "flow", "ray_direction", next=after)
    with np.errstate(invalid="ignore"):
        expected = after.project(after.world_from_camera()[:3, 3] + labels.ray_direction) - centres(camera)
    np.testing.assert_allclose(labels.flow, expected, atol=1e-9)


def test_e3_occlusion_is_what_a_ray_finds():
    """Points of the floor behind the ball in the next picture, by the distance of the ball's centre to the line."""
    camera = every_camera()["PerspectiveCamera"].resized(160, 120)
    after = camera.replace(eye=(2.5, 1.6, 4.6))
    labels = sr.label(
        scene(camera, BALL, FLOOR), "occlusion", "out_of_view", "position", "instance", "flow", next=after
    )
    floor = (labels.instance == 1) & ~labels.out_of_view
    p, eye = labels.position[floor], np.array(after.eye)
    to = p - eye
    s = np.clip(((BALL.center - eye) * to).sum(-1) / (to * to).sum(-1), 0, 1)
    gap = np.linalg.norm(eye + s[:, None] * to - BALL.center, axis=-1) - BALL.radius
    clear = np.abs(gap) > 1e-9
    assert ((gap < 0) == labels.occlusion[floor])[clear].all()
    assert 100 < labels.occlusion.sum() < 5000
    ball = (labels.instance == 0) & ~labels.out_of_view
    behind = ((labels.position[ball] - BALL.center) * (eye - labels.position[ball])).sum(-1) < 0
    assert (labels.occlusion[ball] == behind).mean() > 0.999


def test_out_of_view_is_outside_the_borders_or_behind():
    camera = every_camera()["PerspectiveCamera"]
    after = camera.replace(eye=(0.4, 1.6, 1.0), target=(0.1, 0.3, -4.0))
    labels = sr.label(scene(camera), "flow", "out_of_view", next=after)
    there = labels.flow + centres(camera)
    with np.errstate(invalid="ignore"):
        inside = (there >= 0).all(-1) & (there[..., 0] < camera.width) & (there[..., 1] < camera.height)
    assert (labels.out_of_view == ~inside).all()
    assert np.isnan(there).any()


# ----------------------------------------------------------------------------------------------------- ways of moving


def test_deformed_meshes_flow_with_their_triangles():
    camera = every_camera()["PerspectiveCamera"]
    bent = CRATE.replace(vertices=CRATE.vertices * (1, 1.5, 0.8) + CRATE.vertices[:, [2, 0, 1]] * 0.2)
    labels = sr.label(scene(camera, CRATE), "next_position", "uv", "primitive", "instance", next=scene(camera, bent))
    crate = labels.instance == 0
    corners = bent.vertices[bent.faces[labels.primitive[crate]]]
    u, v = labels.uv[crate].T[..., None]
    points = corners[:, 0] * (1 - u - v) + corners[:, 1] * u + corners[:, 2] * v
    np.testing.assert_allclose(labels.next_position[crate], CRATE.transform.point(points), atol=1e-13)


MOVES = [
    (sr.Sphere(), sr.Sphere(center=(0.1, 0.2, 0.3), radius=1.5), lambda p: 1.5 * p + (0.1, 0.2, 0.3)),
    (sr.Torus(), sr.Torus(center=(0, 0.5, 0)), lambda p: np.add(p, (0, 0.5, 0))),
    (sr.Rectangle(), sr.Rectangle(corner=(0, 0, 0.5), edge_u=(2, 0, 0)), lambda p: p * (2, 1, 1) + (1, 0.5, 0.5)),
    (sr.Triangle(a=(-1, -1, 0), b=(1, -1, 0), c=(0, 1, 0)), sr.Triangle(a=(-1, -1, 1), b=(1, -1, 1), c=(1, 1, 1)),
     lambda p: p + np.stack([(p[..., 1] + 1) / 2, 0 * p[..., 0], 1 + 0 * p[..., 0]], axis=-1)),
    (sr.Disk(normal=(0, 0, 1)), sr.Disk(normal=(1, 0, 0)), lambda p: np.stack([p[..., 2], p[..., 1], -p[..., 0]], axis=-1)),
]  # fmt: skip


@pytest.mark.parametrize(("before", "after", "expected"), MOVES, ids=[type(m[0]).__name__ for m in MOVES])
def test_shapes_move_with_their_fields(before, after, expected):
    camera = sr.PerspectiveCamera(eye=(0.3, 0.6, 6), width=30, height=30)
    labels = sr.label(scene(camera, before), "position", "next_position", "instance", next=scene(camera, after))
    on = labels.instance == 0
    assert on.sum() > 20
    np.testing.assert_allclose(labels.next_position[on], expected(labels.position[on]), atol=1e-12)


def test_objects_are_known_again_by_name_and_what_is_gone_has_no_flow():
    camera = every_camera()["PerspectiveCamera"]
    after = scene(camera, EGG, RING, BALL.replace(center=(0, 0, 0)))
    labels = sr.label(scene(camera), "scene_flow", "instance", "flow", next=after)
    ball = labels.scene_flow[labels.instance == 0]
    np.testing.assert_allclose(ball, np.tile((-0.2, -0.6, -0.3), (len(ball), 1)))
    assert np.nanmax(np.abs(labels.flow[(labels.instance == 2) | (labels.instance == 3)])) <= 1e-9
    gone = (labels.instance == 1) | (labels.instance == 4)
    assert np.isnan(labels.flow[gone]).all()
    assert np.isfinite(labels.flow[labels.instance < 0]).all()


@pytest.mark.parametrize(("other", "message"), [
    (RING.replace(minor_radius=0.1), r"object 'ring': the Torus of the other scene differs in minor_radius; allowed:"),
    (sr.Box(name="ring"), r"object 'ring': the Torus of the other scene differs in kind: it is a Box; allowed: the same"),
])  # fmt: skip
def test_another_body_is_refused(other, message):
    camera = every_camera()["PerspectiveCamera"]
    with pytest.raises(sr.SceneError, match=message):
        sr.label(scene(camera, RING), "flow", next=scene(camera, other))


# ---------------------------------------------------------------------------------------------------------- stereo pairs


def stereo_pair(baseline=0.2, **options):
    left = sr.PinholeCamera(fx=120, cx=40, cy=31, width=80, height=60, **options)
    right = left.replace(pose=left.pose @ sr.Transform.translate(baseline, 0, 0))
    return left, right


def test_e4_disparity_is_f_b_over_z_and_left_and_right_agree():
    left, right = stereo_pair(pose=every_camera()["PinholeCamera"].pose)
    a = sr.label(scene(left), "disparity", "depth", "instance", stereo=right)
    met = a.instance >= 0
    np.testing.assert_allclose(a.disparity[met], 120 * 0.2 / a.depth[met], rtol=1e-11)
    assert (a.disparity[~met] == 0).all()
    b = sr.label(scene(right), "disparity", "depth", "instance", stereo=left)
    on = b.instance >= 0
    np.testing.assert_allclose(b.disparity[on], 120 * 0.2 / b.depth[on], rtol=1e-11)
    # The point that the left picture shows at x is shown by the right one at x - d, with the same disparity.
    pixels = centres(left) - a.disparity[..., None] * (1, 0)
    o, d = right.rays(pixels[met])
    hits = scene(right).intersect(o, d)
    depth = (hits.position - right.pose.matrix[:3, 3]) @ right.pose.matrix[:3, 2]
    same = (hits.shape == a.instance[met]) & (np.abs(depth - a.depth[met]) < 1e-6)
    assert same.mean() > 0.8
    np.testing.assert_allclose(120 * 0.2 / depth[same], a.disparity[met][same], rtol=1e-9)


def test_e4_a_wall_at_a_whole_disparity_is_the_same_in_both_pictures():
    left, right = stereo_pair()
    wall = sr.Plane(point=(0, 0, 3.0), normal=(0, 0, -1))  # 120 * 0.2 / 3 = 8 pixels
    a, b = (
        sr.label(scene(left, wall), "disparity", stereo=right),
        sr.label(scene(right, wall), "disparity", stereo=left),
    )
    np.testing.assert_allclose(a.disparity, 8.0, rtol=1e-12)
    np.testing.assert_allclose(b.disparity[:, :-8], a.disparity[:, 8:], rtol=1e-12)


@pytest.mark.parametrize("change", [
    {"pose": sr.Transform.translate(0.2, 0.01, 0)}, {"pose": sr.Transform.rotate((0, 1, 0), 1)}, {"fx": 121.0}, {"cy": 30.0},
])  # fmt: skip
def test_cameras_that_are_not_rectified_are_refused(change):
    left, right = stereo_pair()
    with pytest.raises(sr.SceneError, match="not rectified"):
        sr.label(scene(left), "disparity", stereo=right.replace(**change))


# ----------------------------------------------------------------------------------------------------- epipolar geometry


def test_true_correspondences_obey_the_fundamental_and_the_essential_matrix():
    camera = every_camera()["PinholeCamera"]
    after = aside(camera)
    labels = sr.label(scene(camera), "correspondence", "fundamental", "essential", "instance", next=after)
    good = np.isfinite(labels.correspondence[..., 0]) & (labels.instance >= 0)
    x0 = np.append(centres(camera)[good], np.ones((good.sum(), 1)), axis=1)
    x1 = np.append(labels.correspondence[good], np.ones((good.sum(), 1)), axis=1)
    lines, back = x0 @ labels.fundamental.T, x1 @ labels.fundamental
    value = (x1 * lines).sum(-1)
    sampson = value**2 / (lines[:, 0] ** 2 + lines[:, 1] ** 2 + back[:, 0] ** 2 + back[:, 1] ** 2)
    assert np.sqrt(sampson).max() <= 1e-9  # pixels
    y0, y1 = x0 @ np.linalg.inv(camera.intrinsics()).T, x1 @ np.linalg.inv(after.intrinsics()).T
    assert np.abs(np.einsum("ni,ij,nj->n", y1, labels.essential, y0)).max() <= 1e-12
    assert np.linalg.svd(labels.fundamental)[1][2] <= 1e-15
    s = np.linalg.svd(labels.essential)[1]
    np.testing.assert_allclose(s, [s[0], s[0], 0], atol=1e-14)


def test_only_pinholes_have_a_fundamental_matrix():
    camera = every_camera()["OrthographicCamera"]
    with pytest.raises(sr.SceneError, match="OrthographicCamera is no pinhole"):
        sr.label(scene(camera), "fundamental", next=camera)


# ------------------------------------------------------------------------------------------------------- time and motion


def spinning():
    """A ball that goes by and a crate that turns, each in the frame of its instance."""
    turn = [(t, sr.Transform.rotate((0, 1, 0), 60 * t)) for t in (0.0, 1.0)]
    return (
        sr.Instance(of=BALL, motion=[(0.0, None), (1.0, sr.Transform.translate(0.5, 0.1, 0))], name="ball"), FLOOR,
        sr.Instance(of=CRATE, motion=turn, name="crate"),
    )  # fmt: skip


def test_e3_flow_between_two_times_is_that_between_two_scenes():
    camera = every_camera()["PerspectiveCamera"].replace(shutter_open=0.2, shutter_close=0.4)
    room = scene(camera, *spinning())
    still, after = room.at(0.3), room.at(0.55)
    wanted = ("flow", "instance", "depth", "occlusion", "object_position", "poses", "normal")
    moving = sr.label(room, *wanted, next=0.25)
    plain = sr.label(still, *wanted, next=after)
    assert {0, 1, 2} <= set(np.unique(plain.instance))
    for name in wanted:
        np.testing.assert_allclose(moving[name], plain[name], atol=1e-9, err_msg=name)
    assert np.nanmax(np.abs(moving.flow[moving.instance == 2])) > 1
    back = sr.label(room, "backward_flow", previous=0.25)
    np.testing.assert_allclose(back.backward_flow, sr.label(still, "flow", next=room.at(0.05)).flow, atol=1e-9)


def test_e9_rolling_shutter_labels_come_from_rays_at_their_own_times():
    """Row by row, what a still scene at that row's time shows."""
    camera = every_camera()["PerspectiveCamera"].replace(readout=0.5)
    room = scene(camera, *spinning())
    labels = sr.label(room, "depth", "instance", "normal", "position")
    for row in (3, 11, 17, 25):
        time = (row + 0.5) / camera.height * 0.5
        then = room.at(time).replace(camera=camera.replace(readout=0.0))
        still = sr.label(then, "depth", "instance", "normal", "position")
        assert (labels.instance[row] == still.instance[row]).all()
        for name in ("depth", "normal", "position"):
            np.testing.assert_allclose(labels[name][row], still[name][row], atol=1e-9, err_msg=name)
    middle = sr.label(room.at(0.25), "instance").instance
    assert (labels.instance != middle).any()


ROLLING = every_camera()["PerspectiveCamera"].replace(readout=0.3)


def time_of_row(y, start: float = 0.0) -> float:
    return start + y / ROLLING.height * 0.3


@pytest.mark.parametrize("carried", [False, True], ids=["camera stands", "camera moves"])
def test_e9_flow_of_what_moves_under_a_rolling_shutter_leads_to_the_same_material_point(carried):
    """The ray of the other picture through x + u, cast at its own row's time, meets that very point of the object."""
    poses = [(0.0, ROLLING.world_from_camera()), (1.0, aside(ROLLING, (0.3, 0.1, -0.2)).world_from_camera())]
    camera = sr.MovingCamera(camera=ROLLING, poses=poses) if carried else ROLLING
    room = scene(camera, *spinning())
    labels = sr.label(
        room, "flow", "occlusion", "out_of_view", "instance", "object_position", "next_position", next=0.25
    )
    later = labels.views["next"].camera
    seen = (labels.instance >= 0) & ~labels.occlusion & ~labels.out_of_view
    checked = dict.fromkeys(np.unique(labels.instance[seen]), 0)
    for row, column in np.argwhere(seen)[::23]:
        index, pixel = labels.instance[row, column], np.array([column, row]) + 0.5 + labels.flow[row, column]
        time = time_of_row(pixel[1], 0.25)
        o, d = later.rays(pixel)
        then = room.at(time)
        hit = then.intersect(o, d)
        assert hit.shape == index
        point = o + hit.t * d
        assert np.abs(point - labels.next_position[row, column]).max() <= 1e-7
        back = np.linalg.inv(object_pose(then.objects[index]))
        inside = back[:3, :3] @ point + back[:3, 3]
        assert np.abs(inside - labels.object_position[row, column]).max() <= 1e-7
        checked[index] += 1
    assert min(checked.values()) >= 1
    assert len(checked) >= 3
    assert labels.occlusion.any()
    hidden = np.argwhere((labels.instance >= 0) & labels.occlusion)
    for row, column in hidden[:: len(hidden) // 8 + 1]:
        pixel = np.array([column, row]) + 0.5 + labels.flow[row, column]
        o, d = later.rays(pixel)
        way = np.linalg.norm(labels.next_position[row, column] - o)
        assert room.at(time_of_row(pixel[1], 0.25)).intersect(o, d).t < way * (1 - 1e-7)


def test_e9_layers_of_objects_under_a_rolling_shutter_are_those_of_each_rows_own_time():
    room = scene(ROLLING, *spinning())
    names = ("amodal_masks", "object_position", "object_coordinates", "surfaces")
    labels = sr.label(room, *names)
    for row in (3, 11, 17, 25):
        then = room.at(time_of_row(row + 0.5)).replace(camera=ROLLING.replace(readout=0.0))
        still = sr.label(then, *names)
        assert (labels.amodal_masks[:, row] == still.amodal_masks[:, row]).all()
        np.testing.assert_allclose(labels.object_position[row], still.object_position[row], atol=1e-9)
        a, b = (slice(*part.surfaces.offsets[[row * 41, row * 41 + 41]]) for part in (labels, still))
        np.testing.assert_allclose(labels.surfaces.distance[a], still.surfaces.distance[b], atol=1e-9)
        assert (labels.surfaces.instance[a] == still.surfaces.instance[b]).all()
    middle = sr.label(room.at(0.15).replace(camera=ROLLING.replace(readout=0.0)), "poses", "object_coordinates")
    np.testing.assert_allclose(sr.label(room, "poses").poses, middle.poses, atol=1e-12)
    met = np.isfinite(labels.object_coordinates).all(axis=-1)
    assert met.any()
    assert ((labels.object_coordinates[met] >= 0) & (labels.object_coordinates[met] <= 1)).all()


def test_e9_keypoints_of_what_moves_are_where_their_rows_find_them():
    room = scene(ROLLING, *spinning())
    moving = next(thing for thing in room.objects if moves(thing))
    ways = np.random.default_rng(4).normal(size=(40, 3))
    points = BALL.center + BALL.radius * ways / np.linalg.norm(ways, axis=1, keepdims=True)
    found = sr.label(room, "keypoints", keypoints={moving.name: points}).keypoints[moving.name]
    index = room.objects.index(moving)
    assert np.isfinite(found).all()
    for (x, y, visibility), inside in zip(found, points, strict=True):
        then = room.at(time_of_row(y))
        pose = object_pose(then.objects[index])
        point = pose[:3, :3] @ inside + pose[:3, 3]
        assert np.abs(ROLLING.replace(readout=0.0).project(point) - (x, y)).max() <= 1e-9
        o, d = ROLLING.rays(np.array([x, y]))
        clear = then.intersect(o, d).t >= np.linalg.norm(point - o) * (1 - 1e-6)
        assert (visibility == 2) == bool(clear)
    assert set(found[:, 2]) == {1, 2}


def test_e9_flow_of_a_still_scene_under_a_rolling_shutter_projects_to_the_row_that_sees_it():
    base = every_camera()["PerspectiveCamera"].replace(readout=0.4)
    poses = [(0.0, base.world_from_camera()), (1.0, aside(base, (0.6, 0.2, -0.3)).world_from_camera())]
    camera = sr.MovingCamera(camera=base, poses=poses)
    labels = sr.label(scene(camera), "flow", "position", "instance", "correspondence", next=0.3)
    met = (labels.instance >= 0) & np.isfinite(labels.correspondence[..., 0])
    assert met.sum() > 400
    o, d = labels.views["next"].camera.rays(labels.correspondence[met])
    to = labels.position[met] - o
    along = (to * d).sum(-1)
    assert np.abs(to - along[:, None] * d).max() <= 1e-9


def test_e9_labels_of_a_moving_camera_are_those_of_the_middle_of_the_exposure():
    base = every_camera()["PerspectiveCamera"].replace(shutter_open=0.2, shutter_close=0.6)
    poses = [(0.0, base.world_from_camera()), (1.0, aside(base, (0.6, 0.2, -0.3)).world_from_camera())]
    camera = sr.MovingCamera(camera=base, poses=poses)
    still = camera.replace(poses=[(0.0, camera.world_from_camera(0.4))])
    moving, plain = (sr.label(scene(c), "ray_origin", "ray_direction", "depth", "instance") for c in (camera, still))
    assert (moving.instance == plain.instance).all()
    for name in ("ray_origin", "ray_direction", "depth"):
        np.testing.assert_allclose(moving[name], plain[name], atol=1e-12, err_msg=name)
    assert np.abs(moving.ray_origin - base.eye).max() > 0.2
