"""How a scene file finds its format, its limits, and the camera around bare geometry."""


import format_examples
import numpy as np
import pytest
from format_examples import CUBE, shapes

from sightray.errors import FormatError, SceneError, SightrayError
from sightray.formats import frame_mesh, load_scene, save_scene, suffixes
from sightray.formats.base import formats
from sightray.mathlib.transform import Transform
from sightray.scene.instance import Group, Instance
from sightray.scene.scene import Scene
from sightray.shapes.mesh import Mesh
from sightray.shapes.sphere import Sphere

write = format_examples.write


def test_every_suffix_has_a_format_and_an_unknown_one_offers_the_nearest(write):
    assert {".yaml", ".yml", ".test", ".obj", ".ply", ".stl", ".glb", ".gltf", ".nff"} <= set(suffixes())
    with pytest.raises(FormatError, match=r"unknown scene suffix '\.yml2'; did you mean '\.yml'\?"):
        load_scene(write("a.yml2", ""))
    with pytest.raises(FormatError, match="no suffix"):
        load_scene(write("plain", ""))
    with pytest.raises(FormatError, match=r"unknown scene suffix '\.test'.*Allowed: \.yaml, \.yml"):
        save_scene(Scene(), "a.test")


def test_missing_file_and_folder_are_one_clear_message(write, tmp_path):
    write("scene.test", "")
    with pytest.raises(FormatError, match=r"scen\.test: no such file; did you mean 'scene\.test'"):
        load_scene(tmp_path / "scen.test")
    (tmp_path / "folder.obj").mkdir()
    with pytest.raises(FormatError, match="is not a file"):
        load_scene(tmp_path / "folder.obj")
    for name in ("\0.obj", "x" * 5000 + ".obj"):
        with pytest.raises(FormatError):
            load_scene(name)


def test_limits_refuse_and_can_be_raised(write):
    quad = write("quad.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    for limit in ({"max_triangles": 1}, {"max_bytes": 10}):
        (name,) = limit
        with pytest.raises(FormatError, match=name):
            load_scene(quad, **limit)
    assert len(shapes(load_scene(quad, max_triangles=2))[0].faces) == 2
    with pytest.raises(SceneError, match="unknown option 'max_byte'; did you mean 'max_bytes'"):
        load_scene(quad, max_byte=1)
    with pytest.raises(SceneError, match="max_bytes: got 0"):
        load_scene(quad, max_bytes=0)


def test_frame_sees_the_whole_bounding_sphere_and_refuses_what_has_no_end():
    from sightray.shapes.plane import Plane

    part = Mesh(vertices=np.add(CUBE.vertices, (100, 5, -3)), faces=CUBE.faces, transform=Transform.scale(0.1))
    parts = [Instance(of=Group(objects=[part])), Sphere(center=(10, 0.5, -0.3), radius=0.1)]
    for width, height in ((640, 480), (100, 400)):
        camera = frame_mesh(parts, width=width, height=height).camera
        p = part.transform.point(part.vertices) @ np.linalg.inv(camera.world_from_camera())[:3, :3].T
        p += np.linalg.inv(camera.world_from_camera())[:3, 3]
        uv = p @ camera.intrinsics().T
        uv = uv[:, :2] / uv[:, 2:]
        assert (p[:, 2] > 0).all()
        assert (uv > 0).all()
        assert (uv < (width, height)).all()
        assert np.allclose(camera.target, (10, 0.5, -0.3))
    with pytest.raises(SceneError, match="without end"):
        frame_mesh([Plane()])
    with pytest.raises(SceneError, match="no geometry"):
        frame_mesh([])


def test_every_format_says_what_it_is():
    for suffix, one in formats().items():
        assert suffix in one.suffixes
        assert one.name
        assert issubclass(FormatError, SightrayError)
