"""Motion: things and cameras that move while the shutter is open."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel, native
from sightray.errors import FormatError, SceneError
from sightray.mathlib.motion import Motion, Placement
from sightray.mathlib.moving import inverse, point_by, pose_at, transposed_by, vector_by
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, vec3_at, vec3_put
from sightray.mathlib.vec import Vec3, normalize
from sightray.registry import members
from sightray.scene.compile import compile_scene
from sightray.scene.world import find_closest, point_of, thin_beam

T = sr.Transform


def some_pose(generator) -> sr.Transform:
    """Any invertible map that is no mirror."""
    stretch = T.rotate(generator.normal(size=3), 40) @ T.scale(*generator.uniform(0.5, 2, 3))
    return T.translate(*generator.normal(size=3)) @ T.rotate(generator.normal(size=3), 300) @ stretch


def some_motion(seed: int, keyframes: int = 3) -> Motion:
    generator = np.random.default_rng(seed)
    return Motion([(0.5 * k - 0.2, some_pose(generator)) for k in range(keyframes)])


PLACEMENTS = [
    Placement(),
    Placement().within(T.translate(1, 2, 3), some_motion(0)),
    Placement().within(T(), some_motion(1, 1)).within(T.rotate((1, 1, 0), 50), None),
    Placement().within(T.scale(2, 1, 1), some_motion(2, 5)).within(T.rotate((1, 0, 0), 20), some_motion(3, 2)),
]


# --- poses ---------------------------------------------------------------------------------------------------------


def test_a_turn_goes_on_evenly_while_the_thing_moves_and_grows():
    """Halfway through a quarter turn about an axis stands an eighth of a turn; shifts and sizes are means."""
    axis = (1, 2, -1)
    end = T.translate(4, 0, 2) @ T.rotate(axis, 90) @ T.scale(3)
    motion = Motion([(1.0, T()), (3.0, end)])
    np.testing.assert_allclose(motion.matrices(2.0), (T.translate(2, 0, 1) @ T.rotate(axis, 45) @ T.scale(2)).matrix,
                               atol=1e-15)  # fmt: skip
    np.testing.assert_allclose(motion.matrices(1.5)[:3, :3], (T.rotate(axis, 22.5) @ T.scale(1.5)).matrix[:3, :3],
                               atol=1e-15)  # fmt: skip
    np.testing.assert_array_equal(motion.matrices([-9.0, 1.0]), np.tile(np.eye(4), (2, 1, 1)))
    np.testing.assert_allclose(motion.matrices([3.0, 99.0]), [end.matrix] * 2, atol=1e-15)


def test_a_motion_passes_through_its_keyframes():
    for seed in range(5):
        motion = some_motion(seed, 6)
        np.testing.assert_allclose(motion.matrices(motion.times), [p.matrix for p in motion.poses], atol=1e-14)
        with_mirror = Motion([(t, p @ T.scale(1, 1, -1)) for t, p in zip(motion.times, motion.poses, strict=True)])
        found = np.linalg.det(with_mirror.matrices(np.linspace(0, 2, 50))[:, :3, :3])
        assert (found < -1e-3).all()  # never without volume


def test_opposite_quaternions_do_not_turn_the_long_way_round():
    """Keyframes by 100 degrees, all the way round: each step turns by 100, not by 260."""
    motion = Motion([(k, T.rotate((0, 1, 0), 100 * k)) for k in range(8)])
    for k in range(7):
        np.testing.assert_allclose(motion.matrices(k + 0.5), T.rotate((0, 1, 0), 100 * k + 50).matrix, atol=1e-14)


@kernel
def place_all(placement: Table, count: i64, times: Table, p: Table, out: Table) -> i64:
    """A point, a vector and back, and a normal at some times."""
    for i in range(count):
        pose = pose_at(placement, f64_at(times, i))
        q = point_by(pose, vec3_at(p, 0))
        back = inverse(pose)
        vec3_put(out, 16 * i, q)
        vec3_put(out, 16 * i + 4, vector_by(pose, vec3_at(p, 4)))
        vec3_put(out, 16 * i + 8, point_by(back, q))
        vec3_put(out, 16 * i + 12, transposed_by(back, vec3_at(p, 4)))
    return count


@pytest.mark.parametrize("placement", PLACEMENTS)
@pytest.mark.parametrize("compiled", [True, False])
def test_kernels_place_as_matrices_do(placement, compiled):
    times = np.concatenate([np.linspace(-0.5, 2.5, 41), [-0.2, 0.3, 0.8, 1.3]])
    p = np.array([0.3, -1.0, 2.0, 0.7, 1.0, 2.0, -0.5, 0.0])
    row, out = Table(placement.table()), np.zeros((len(times), 16))
    (native(place_all) if compiled else place_all)(row, len(times), Table(times), Table(p), Table(out))
    for time, found in zip(times, out, strict=True):
        at = placement.at(time)
        np.testing.assert_allclose(found[0:3], at.point(p[:3]), atol=1e-13)
        np.testing.assert_allclose(found[4:7], at.direction(p[4:7]), atol=1e-13)
        np.testing.assert_allclose(found[8:11], p[:3], atol=1e-12)
        np.testing.assert_allclose(found[12:15], at.normal(p[4:7]), atol=1e-12)
        assert (found[[3, 7, 11, 15]] == 0).all()  # no time in what is no point of a ray


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_bounds_hold_at_all_times(placement):
    generator = np.random.default_rng(4)
    lower, upper = np.array([-1.0, -0.5, 0.2]), np.array([2.0, 0.5, 0.3])
    box = placement.bounds(lower, upper)
    points = np.vstack([generator.uniform(lower, upper, (20, 3)), [lower, upper]])
    places = np.concatenate([placement.at(t).point(points) for t in np.linspace(-1, 3, 1000)])
    assert (places >= box[0] - 1e-12).all()
    assert (places <= box[1] + 1e-12).all()
    assert (np.ptp(places, axis=0) > 0.4 * (box[1] - box[0])).all()  # and are not much too large


def test_the_slack_of_bounds_is_needed():
    """Half a turn of a point far from the axis: 16 samples alone would miss the end of the arc."""
    motion = Motion([(0.0, T.rotate((0, 0, 1), -85)), (1.0, T.rotate((0, 0, 1), 88))])
    _, upper = motion.bounds(np.array([10.0, 0, 0]), np.array([10.0, 0, 0]))
    assert 10 <= upper[0] < 10.1
    times = np.arange(17) / 16
    assert motion.matrices(times)[:, 0, 0].max() * 10 < 10 - 1e-3


# --- pictures ------------------------------------------------------------------------------------------------------


def moving_scene(time: float) -> sr.Scene:
    """All that can move, in shadows, mirrors and glass, seen at one moment."""
    generator = np.random.default_rng(5)
    vertices, faces = generator.uniform(-0.6, 0.6, (30, 3)), np.arange(30).reshape(10, 3)
    mesh = sr.Mesh(vertices=vertices, faces=faces, material=sr.Lambert(albedo=(0.9, 0.3, 0.2)))
    sided = sr.Lambert(albedo=sr.Triplanar(x=(0.9, 0.1, 0.1), y=(0.1, 0.9, 0.1), z=(0.1, 0.1, 0.9), sharpness=1))
    wheel = sr.Group(
        objects=[
            sr.Instance(of=mesh, transform=T.translate(0.7, 0, 0)),
            sr.Box(lower=(-1, -0.1, -0.1), upper=(0, 0.1, 0.2), material=sided),
        ],
        transform=T.translate(-1.2, 0.9, 0),
        motion=[(0.0, T()), (1.0, T.rotate((0, 0, 1), 140))],
    )
    solid = sr.Lambert(albedo=sr.Checker(mode="solid", scale=3, even=0.9, odd=(0.2, 0.4, 0.8)))
    keyframes = [(-1, T()), (0.2, T.translate(1, 1, 0)), (2, T.translate(1.5, 0.5, 1) @ T.scale(1, 2, 1))]
    ball = sr.Instance(of=sr.Sphere(radius=0.5, material=solid), motion=keyframes)
    small = [sr.Mesh(vertices=T.translate(x, 1.5, -1).point(vertices), faces=faces) for x in (-2, 2)]
    return sr.Scene(
        small[0],  # these two could be merged, if one did not leave
        sr.Instance(of=small[1], motion=[(0.0, T()), (1.0, T.translate(-2, 0.5, 0))]),
        sr.Plane(point=(0, -0.5, 0), normal=(0, 1, 0), material=sr.Lambert(albedo=0.6)),
        wheel, ball,
        sr.Instance(of=wheel, transform=T.translate(0.5, 0, -2), motion=[(0, T()), (1, T.translate(1, 0.5, 0))]),
        sr.Sphere(center=(1.6, 0.2, 1.5), radius=0.7, material=sr.Mirror()),
        sr.Instance(of=sr.Sphere(radius=0.6, material=sr.Mirror()), transform=T.translate(-1.5, 0.1, 1.8)),
        sr.Sphere(center=(0, 0, 2.2), radius=0.4, material=sr.Glass(ior=1.5)),
        sr.PointLight(position=(2, 5, 4), intensity=120),
        camera=sr.PerspectiveCamera(eye=(0, 1.5, 6), target=(0, 0.5, 0), width=96, height=72, shutter_open=time,
                                    shutter_close=time),
        background=(0.2, 0.3, 0.5), ambient=0.1,
    )  # fmt: skip


@pytest.mark.parametrize("time", [0.0, 0.35, 0.8])
def test_an_instant_of_a_moving_scene_is_a_picture_of_the_scene_at_that_time(time):
    scene = moving_scene(time)
    moving, still = (np.asarray(sr.render(s, sr.Whitted(max_depth=6))) for s in (scene, scene.at(time)))
    assert np.mean(np.abs(moving - still).max(axis=2) > 1e-6) < 2e-3  # rays that graze an edge may go either way
    if time > 0:
        first = np.asarray(sr.render(scene.at(0.0), sr.Whitted(max_depth=6)))
        assert np.mean(np.abs(still - first).max(axis=2) > 0.02) > 0.1


@pytest.mark.parametrize("name", sorted(members("accelerators")))
def test_every_structure_finds_what_moves(name):
    cls = members("accelerators")[name]
    if not cls.__module__.startswith("sightray."):
        return
    time = 0.8
    scene = moving_scene(time)
    scene = scene.replace(camera=scene.camera.resized(48, 36))
    expected = np.asarray(sr.render(scene.at(time), sr.Whitted(max_depth=3)))
    found = np.asarray(sr.render(scene, sr.Whitted(max_depth=3), accelerator=cls()))
    assert np.mean(np.abs(found - expected).max(axis=2) > 1e-6) < 4e-3


def test_paths_see_one_moment_all_along():
    """A picture at an instant, by path tracing, is that of the still scene sample by sample."""
    scene = moving_scene(0.8)
    moving, still = (np.asarray(sr.render(s, sr.PathTracer(max_depth=4), samples=4)) for s in (scene, scene.at(0.8)))
    assert np.mean(np.abs(moving - still).max(axis=2) > 1e-6) < 0.02


def test_only_points_of_rays_carry_the_time():
    """Normals and tangents do not, so that no direction made of them does."""
    scene = moving_scene(0.0)
    world = compile_scene(scene).world
    for root in (find_closest, point_of):
        compile_scene(scene).tables.prepare(root, compiled=False)
    rng = np.random.default_rng(8)
    seen = 0
    for target in rng.uniform(-2, 2, (60, 3)):
        o, d = Vec3(0, 1.5, 6, 0.3), normalize(Vec3(*(target - (0, 1.5, 6))))
        hit = find_closest(world, o, d, 0.0, math.inf)
        if hit.item >= 0:
            point = point_of(world, hit, o, d, thin_beam())
            assert point.p.w == 0.3
            assert [v.w for v in (point.normal, point.shading, point.tangent, point.where.normal)] == [0, 0, 0, 0]
            seen += 1
    assert seen > 20


def edge_scene(camera, **motion) -> sr.Scene:
    """A glowing half-plane, x < 0 at rest."""
    sheet = sr.Rectangle(corner=(-100, -50, 0), edge_u=(100, 0, 0), edge_v=(0, 100, 0), material=sr.Emitter(radiance=1.0))
    return sr.Scene(sr.Instance(of=sheet, **motion), camera=camera)


FLAT = {"eye": (0, 0, 5), "target": (0, 0, 0), "view_height": 24, "width": 64, "height": 24}  # one pixel a metre


def test_the_blur_of_a_moving_edge_is_a_ramp():
    """It crosses 40 pixels while the shutter is open: each is covered for the time that is left to it."""
    camera = sr.OrthographicCamera(**FLAT, shutter_open=2.0, shutter_close=3.0)
    scene = edge_scene(camera, motion=[(2.0, T.translate(-20, 0, 0)), (3.0, T.translate(20, 0, 0))])
    samples = 64
    row = np.asarray(sr.render(scene, sr.PathTracer(), samples=samples, filter=sr.BoxFilter()))[..., 0].mean(axis=0)
    expected = np.clip((52 - (np.arange(64) + 0.5)) / 40, 0, 1)
    sigma = np.sqrt(expected * (1 - expected) / (samples * 24))
    assert (np.abs(row - expected) <= 4.5 * sigma + 1e-6).all()


def test_a_rolling_shutter_lets_a_moving_edge_lean():
    """30 m/s, one pixel a metre, 0.5 s from the top row to the bottom: 15 pixels."""
    camera = sr.OrthographicCamera(**FLAT, readout=0.5)
    scene = edge_scene(camera, motion=[(0.0, T()), (1.0, T.translate(30, 0, 0))])
    picture = np.asarray(sr.render(scene, sr.PathTracer(), samples=256, filter=sr.BoxFilter()))[..., 0]
    expected = 32 + 30 * 0.5 * (np.arange(24) + 0.5) / 24
    np.testing.assert_allclose(picture.sum(axis=1), expected, atol=0.1)


# --- moving cameras ------------------------------------------------------------------------------------------------


def carried(**options) -> sr.MovingCamera:
    there = sr.PerspectiveCamera(eye=(2, 1.5, 5), target=(0, 0.5, 0))
    poses = [(0.0, {"eye": (0, 1, 6), "target": (0, 0, 0)}), (1.0, there)]
    return sr.MovingCamera(camera=sr.PerspectiveCamera(width=96, height=72, **options), poses=poses)


def test_a_moving_camera_at_an_instant_is_a_camera_at_that_pose():
    camera = carried(shutter_open=0.4, shutter_close=0.4)
    fixed = sr.PinholeCamera(fx=36 / math.tan(math.radians(22.5)), pose=camera.poses.matrices(0.4), width=96, height=72)
    scene = moving_scene(0.0).at(0.0)
    a, b = (np.asarray(sr.render(scene.replace(camera=c), sr.Whitted(max_depth=3))) for c in (camera, fixed))
    assert np.mean(np.abs(a - b).max(axis=2) > 1e-6) < 2e-3
    points = np.random.default_rng(6).normal(size=(50, 3))
    np.testing.assert_allclose(camera.project(points), fixed.project(points), atol=1e-10)
    np.testing.assert_allclose(carried().project(points, time=0.4), fixed.project(points), atol=1e-10)


def test_poses_of_cameras_and_mappings_are_those_of_cameras():
    found = carried().world_from_camera(np.array([0.0, 1.0]))
    for pose, eye, target in zip(found, [(0, 1, 6), (2, 1.5, 5)], [(0, 0, 0), (0, 0.5, 0)], strict=True):
        np.testing.assert_allclose(pose, sr.PerspectiveCamera(eye=eye, target=target).world_from_camera(), atol=1e-15)
    middle = carried(shutter_open=0.2, shutter_close=0.6, readout=0.2)
    np.testing.assert_allclose(middle.world_from_camera(), middle.poses.matrices(0.5))


def test_a_row_of_a_rolling_shutter_looks_from_its_own_pose():
    """Points seen by rays of the middle of a row's exposure project back to that row, to rounding error."""
    camera = carried(shutter_open=0.1, shutter_close=0.2, readout=0.7)
    pixels = np.random.default_rng(7).uniform(0, 1, (200, 2)) * (96, 72)
    o, d = camera.rays(pixels)
    np.testing.assert_allclose(camera.project(o + 4 * d), pixels, atol=1e-9)
    still = carried(shutter_open=0.1, shutter_close=0.2)
    assert np.abs(still.project(o + 4 * d) - pixels).max() > 5


# --- stating it ----------------------------------------------------------------------------------------------------


def test_yaml_states_motions_and_moving_cameras(tmp_path):
    scene = moving_scene(0.3).replace(camera=carried(shutter_close=0.5, readout=0.1))
    sr.save(scene, tmp_path / "scene.yaml")
    again = sr.load(tmp_path / "scene.yaml")
    assert [getattr(a, "motion", None) for a in again.objects] == [getattr(a, "motion", None) for a in scene.objects]
    assert again.camera.poses == scene.camera.poses
    (tmp_path / "by_hand.yaml").write_text("""
camera:
  type: MovingCamera
  camera: {type: PerspectiveCamera, shutter_close: 0.5}
  poses:
    - {time: 0, eye: [0, 0, 5], target: [0, 0, 0]}
    - {time: 1, eye: [1, 0, 5], target: [0, 0, 0]}
objects:
  - type: Instance
    of: {type: Sphere}
    motion:
      - {time: 0, transform: []}
      - {time: 1, transform: [{rotate: {axis: [0, 1, 0], degrees: 90}}, {translate: [1, 2, 3]}]}
""")
    by_hand = sr.load(tmp_path / "by_hand.yaml")
    assert by_hand.objects[0].motion.poses[1] == T.translate(1, 2, 3) @ T.rotate((0, 1, 0), 90)
    np.testing.assert_allclose(by_hand.camera.world_from_camera(1.0)[:3, 3], (1, 0, 5))


def test_queries_see_time_0_or_a_scene_at_its_time():
    scene = sr.Scene(sr.Instance(of=sr.Sphere(), motion=[(0, T()), (1, T.translate(4, 0, 0))]))
    rays = ((0, 0, 5), (2, 0, 5)), (0, 0, -1)
    assert scene.intersect(*rays).t.tolist() == [4, math.inf]
    assert scene.at(0.5).intersect(*rays).t.tolist() == [math.inf, 4]
    assert scene.at(0.5).at(1.0).intersect(*rays).t.tolist() == [math.inf, 4]


@pytest.mark.parametrize(("make", "message"), [
    (lambda: sr.Instance(of=sr.Sphere(), motion=3), r"Instance\.motion: got 3; allowed: a list of keyframes \[seconds"),
    (lambda: sr.Instance(of=sr.Sphere(), motion=[(0, T()), (0, T())]), r"motion: got the times \[0\.0, 0\.0\]; allowed"),
    (lambda: sr.Instance(of=sr.Sphere(), motion=[]), r"Instance\.motion: got the times \[\]"),
    (lambda: sr.Instance(of=sr.Sphere(), motion=[(0, np.zeros((4, 4)))]), r"Instance\.motion: the last row is"),
    (lambda: sr.Instance(of=sr.Sphere(), motion=[(0, T()), (1, T.scale(-1))]), "mirror image of another"),
    (lambda: sr.MovingCamera(poses=[(0, np.eye(4))]), r"MovingCamera\.camera: missing"),
    (lambda: sr.MovingCamera(camera=sr.PerspectiveCamera(), poses=[(0, T.scale(2))]), "axes are not orthonormal"),
    (lambda: sr.MovingCamera(camera=sr.PerspectiveCamera(), poses=[(0, {"eye": (0, 0, 0)})]), "a mapping with eye, target"),
    (lambda: sr.MovingCamera(camera=sr.PerspectiveCamera(), poses=[(0, {"eye": (0, 1), "target": (0, 0, 0)})]),
     r"MovingCamera\.poses: PerspectiveCamera\.eye: got \(0, 1\)"),
    (lambda: sr.MovingCamera(camera=sr.PerspectiveCamera(), width=3), r"MovingCamera: unknown field 'width'"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()


def test_yaml_says_which_keyframe_is_wrong(tmp_path):
    (tmp_path / "a.yaml").write_text("objects:\n- type: Instance\n  of: {type: Sphere}\n  motion:\n  - {time: 0}\n")
    with pytest.raises(FormatError, match=r"a\.yaml:5: .*motion\[0\]: expected 'time: seconds, transform"):
        sr.load(tmp_path / "a.yaml")
