"""Two pictures of what moves while their rows are exposed one after the other: mirrors, glass, stereo, and soft bodies."""

from __future__ import annotations

import numpy as np
import pytest
from label_scenes import BALL, CRATE, FLOOR, centres

import sightray as sr
from sightray.vision.poses import object_pose
from sightray.vision.rigs import stereo_rig

READOUT = 0.3
CAMERA = sr.PerspectiveCamera(eye=(0.3, 0.7, 5), target=(0.2, 0.2, 0), vfov=40, width=61, height=45, readout=READOUT)
SPEED = np.array([0.5, -0.4, 0.3])  # metres a second


def row_time(y, start: float = 0.0):
    return start + y / CAMERA.height * READOUT


def drifting(shape: sr.Shape, speed, name: str) -> sr.Instance:
    """A shape that moves evenly."""
    ends = [(t, sr.Transform.translate(*(t * np.asarray(speed)))) for t in (-4.0, 4.0)]
    return sr.Instance(of=shape, motion=ends, name=name)


def settle(see, start: np.ndarray, after: float) -> np.ndarray:
    """Pixels (n, 2) that show a point at their own rows' times: `see` gives them for times (n,). By bisection."""
    low, high = np.full(len(start), after - 1.0), np.full(len(start), after + 1.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        late = row_time(see(middle)[:, 1], after) > middle
        low, high = np.where(late, middle, low), np.where(late, high, middle)
    return see(0.5 * (low + high))


def test_e5_flow_in_a_mirror_that_moves_under_a_rolling_shutter_is_by_the_method_of_images():
    """The ball's image stands as far behind the mirror as the ball before it, where both are at the row's time."""
    wall = sr.Rectangle(corner=(-4, -4, 0), edge_u=(8, 0, 0), edge_v=(0, 8, 0), material=sr.Mirror())
    ball = sr.Sphere(center=(1.8, 1.4, 1.5), radius=0.6)
    push = 0.4  # of the mirror, metres a second towards the camera
    room = sr.Scene(drifting(wall, (0, 0, push), "wall"), drifting(ball, SPEED, "ball"), camera=CAMERA)
    labels = sr.label(room, "mirrored_flow", "mirrored_position", "mirrored_instance", "instance", next=0.25)
    seen = (labels.mirrored_instance == 1) & (labels.instance == 0)
    solved = np.isfinite(labels.mirrored_flow[..., 0]) & seen
    assert solved.sum() > 0.8 * seen.sum() > 50

    pixels = centres(CAMERA)[solved]
    start = labels.mirrored_position[solved] - np.outer(row_time(pixels[:, 1]), SPEED)
    assert np.abs(np.linalg.norm(start - ball.center, axis=1) - 0.6).max() < 1e-9

    def see(times):
        point = start + np.outer(times, SPEED)
        return CAMERA.project(np.stack([point[:, 0], point[:, 1], 2 * push * times - point[:, 2]], axis=1))

    expected = settle(see, pixels, 0.25) - pixels
    assert np.abs(labels.mirrored_flow[solved] - expected).max() <= 1e-6
    assert np.abs(see(row_time(pixels[:, 1], 0.25)) - pixels - expected).max() > 1e-3  # rows decide


def test_e5_flow_through_glass_under_a_rolling_shutter_leads_to_the_same_material_point():
    """Through x + u, at that row's time, the slab shows the very point of the ball or the crate that x showed at its own."""
    slab = sr.Box(lower=(-3, -3, 1.2), upper=(3, 3, 1.8), material=sr.Glass(ior=1.5),
                  transform=sr.Transform.rotate((0, 1, 0), 25))  # fmt: skip
    crate = CRATE.replace(transform=sr.Transform.translate(-1.5, 0, -1.5) @ CRATE.transform)
    room = sr.Scene(drifting(slab, (0.2, 0, 0), "slab"), drifting(BALL, SPEED, "ball"), drifting(crate, SPEED, "crate"),
                    camera=CAMERA)  # fmt: skip
    labels = sr.label(room, "refracted_flow", "refracted_position", "refracted_instance", next=0.25)
    found = np.isfinite(labels.refracted_flow[..., 0])
    chosen = [np.argwhere(found & (labels.refracted_instance == k)) for k in (1, 2)]
    assert min(map(len, chosen)) > 20
    for row, column in np.concatenate([part[:: len(part) // 6] for part in chosen]):
        pixel = np.array([column, row]) + 0.5 + labels.refracted_flow[row, column]
        time = row_time(pixel[1], 0.25)
        moved = labels.refracted_position[row, column] + SPEED * (time - row_time(row + 0.5))
        o, d = CAMERA.rays(pixel)
        eye = CAMERA.replace(eye=o, target=o + d, vfov=1, width=1, height=1, readout=0)
        there = sr.label(room.at(time), "refracted_position", camera=eye).refracted_position[0, 0]
        assert np.abs(there - moved).max() <= 1e-7


def rolling_pair(**change) -> tuple[sr.Camera, sr.Camera]:
    left, right = stereo_rig(CAMERA, 0.2).at(CAMERA.world_from_camera()).values()
    return left, right.replace(**change)


def carried(camera: sr.Camera, turn: float = 0.0) -> sr.MovingCamera:
    """The camera on its way, in the frame of its own pose: aside and forward."""
    pose, way = camera.world_from_camera(), sr.Transform.translate(0.3, 0.1, 0.4) @ sr.Transform.rotate((0, 1, 0), turn)
    return sr.MovingCamera(camera=camera, poses=[(0.0, pose), (1.0, way.matrix @ pose)])


def on_a_rig(turn: float) -> list[sr.MovingCamera]:
    """The pair on a rig that turns: the right one sits beside the left one, whose poses those of the rig are."""
    left, right = rolling_pair()
    aside = np.linalg.inv(left.world_from_camera()) @ right.world_from_camera()
    poses = carried(left, turn).poses
    return [
        sr.MovingCamera(camera=camera, poses=poses, mount=mount) for camera, mount in ((left, None), (right, aside))
    ]


PAIRS = {
    "cameras stand": rolling_pair(), "cameras move": tuple(map(carried, rolling_pair())), "cameras turn": on_a_rig(40),
}  # fmt: skip


@pytest.mark.parametrize("name", PAIRS)
def test_e4_disparity_of_what_moves_under_a_rolling_shutter_is_that_of_the_rows_own_depth(name):
    (left, right), moving = PAIRS[name], name != "cameras stand"
    room = sr.Scene(drifting(BALL, SPEED, "ball"), FLOOR, drifting(CRATE, (0, 0.5, 0), "crate"))
    strength = CAMERA.intrinsics()[0, 0] * 0.2  # f B
    for camera, other in ((left, right), (right, left)):
        labels = sr.label(room, "disparity", "position", "instance", camera=camera, stereo=other)
        assert {-1, 0, 1, 2} <= set(np.unique(labels.instance))
        for row in (4, 14, 25, 36):
            on = labels.instance[row] >= 0
            pose = camera.world_from_camera(row_time(row + 0.5)) if moving else camera.world_from_camera()
            depth = (labels.position[row, on] - pose[:3, 3]) @ pose[:3, 2]
            np.testing.assert_allclose(labels.disparity[row, on], strength / depth, rtol=1e-9)
        assert (labels.disparity[labels.instance < 0] == 0).all()
        there = sr.label(room, "flow", "disparity", "instance", camera=camera, stereo=other, next=other)
        seen, side = there.instance >= 0, 1 if camera is left else -1
        np.testing.assert_allclose(-side * there.flow[seen][:, 0], there.disparity[seen], atol=1e-9)
        assert np.abs(there.flow[seen][:, 1]).max() <= 1e-9  # the same row


def test_a_mount_turns_with_what_carries_it():
    """Midway through a turn by 90 degrees about the origin a camera that sits 2 m ahead stands on the arc, not the chord."""
    ahead = sr.Transform.translate(0, 0, 2).matrix
    turn = [(0.0, np.eye(4)), (1.0, sr.Transform.rotate((0, 1, 0), 90).matrix)]
    camera = sr.MovingCamera(camera=CAMERA.replace(readout=0), poses=turn, mount=ahead)
    half = np.array([np.sin(np.pi / 4), 0, np.cos(np.pi / 4)])
    np.testing.assert_allclose(camera.world_from_camera(0.5)[:3, [2, 3]].T, [half, 2 * half], atol=1e-12)
    at_half = camera.replace(camera=CAMERA.replace(readout=0, shutter_open=0.5, shutter_close=0.5))
    target = sr.Sphere(center=5 * half, radius=0.5)
    labels = sr.label(sr.Scene(target, camera=at_half), "depth", "ray_origin")
    np.testing.assert_allclose(labels.ray_origin[20, 30], 2 * half, atol=1e-12)
    assert abs(labels.depth[22, 30] - 2.5) < 1e-3
    np.testing.assert_allclose(at_half.rays([30.5, 22.5])[1], half, atol=1e-12)
    np.testing.assert_allclose(at_half.project(3 * half), [30.5, 22.5], atol=1e-9)


@pytest.mark.parametrize(("pair", "message"), [
    (rolling_pair(readout=0.2), "in other rows of the other picture"),
    (rolling_pair(shutter_open=0.1, shutter_close=0.1), "in other rows of the other picture"),
    (tuple(carried(camera, 30) for camera in rolling_pair()), "not rectified.* at the time of every row: see Moving"),
])  # fmt: skip
def test_pairs_that_do_not_show_a_point_in_the_same_row_are_refused(pair, message):
    room = sr.Scene(drifting(BALL, SPEED, "ball"), FLOOR, camera=pair[0])
    with pytest.raises(sr.SceneError, match=message):
        sr.label(room, "disparity", stereo=pair[1])


def test_e9_flow_of_a_mesh_that_is_bent_under_a_rolling_shutter_keeps_to_the_triangles():
    """An affine map of the vertices is the same map of all points; the crate turns meanwhile."""
    bend = np.array([[1.2, 0.2, 0], [0, 0.9, 0.1], [0.1, 0, 1.1]])
    turn = [(t, sr.Transform.rotate((0, 1, 0), 90 * t)) for t in (-1.0, 1.0)]

    def room(mesh):
        return sr.Scene(sr.Instance(of=mesh, motion=turn, name="crate"), drifting(BALL, SPEED, "ball"), camera=CAMERA)

    before, after = room(CRATE), room(CRATE.replace(vertices=CRATE.vertices @ bend.T))
    labels = sr.label(before, "flow", "next_position", "position", "instance", next=after)
    crate = labels.instance == 0
    assert crate.sum() > 40
    for row, column in np.argwhere(crate)[::7]:
        pixel = np.array([column, row]) + 0.5 + labels.flow[row, column]
        here, there = (object_pose(before.at(t).objects[0]) for t in (row_time(row + 0.5), row_time(pixel[1])))
        inside = np.linalg.inv(here)[:3] @ np.append(labels.position[row, column], 1)
        expected = there @ np.append(bend @ inside, 1)
        assert np.abs(labels.next_position[row, column] - expected[:3]).max() <= 1e-9
        assert np.abs(CAMERA.project(expected[:3]) - pixel).max() <= 1e-9
