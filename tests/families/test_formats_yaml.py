"""The native format: every member comes back field by field, mistakes are named with line and place."""


import format_examples
import numpy as np
import pytest
from format_examples import assert_same, points

import sightray.fields as fields
from sightray.cameras.fisheye import FisheyeCamera
from sightray.errors import FormatError, SceneError
from sightray.formats import load_scene, save_scene
from sightray.materials.glass import Glass
from sightray.materials.lambert import Lambert
from sightray.materials.phong import Phong
from sightray.mathlib.transform import Transform
from sightray.media.homogeneous import HomogeneousMedium
from sightray.registry import members
from sightray.scene.instance import Group, Instance
from sightray.scene.scene import Scene
from sightray.shapes.mesh import Mesh
from sightray.shapes.sphere import Sphere
from sightray.textures.bitmap import Bitmap
from sightray.textures.checker import Checker

write = format_examples.write


def candidate(field):
    """A value for a field that is not its default."""
    if isinstance(field, fields.Choice):
        return next(option for option in field.options if option != field.default)
    if isinstance(field, fields.Flag):
        return not field.default
    if isinstance(field, fields.Integer):
        return next(n for n in (3, 5, 7) if n != field.default)
    if isinstance(field, fields.Number):
        return next(n for n in (0.3, 1.1, 60.0, 7.0) if all(b is None or fields._COMPARE[s](n, b) for b, s in field.bounds))
    if isinstance(field, fields.ColorField):
        return (0.1, 1 / 3, 0.7)
    if isinstance(field, fields.Vector):
        return {"target": (0.1, 0.2, 0.3), "eye": (5.0, 4.0, 1e-3), "edge_v": (0, 1, 0.5), "upper": (3.0, 4, 5),
                "b": (3, 1, 0), "c": (0, 1, 0.5), "top": (0, 3, 1)}.get(field.name, (1.1, -0.25, 1e-7))  # fmt: skip
    if isinstance(field, fields.Text):
        return "yes: 'no' # 1e3"
    if isinstance(field, fields.Child):
        return {"materials": Lambert(albedo=0.25), "textures": Checker(scale=3),
                "media": HomogeneousMedium(scattering=2)}.get(field.family)  # fmt: skip
    if field.name == "transform":
        return Transform.translate(0.1, 2, 3) @ Transform.rotate((1, 2, 3), 40) @ Transform.scale(1, 1 / 3, 2)
    return None


AIM = {"eye": (1, 2, 3), "target": (0, 0, 1 / 3)}
MOTION = [(-0.5, Transform.scale(2)), (1 / 3, Transform.translate(0.1, 2, 3) @ Transform.rotate((1, 2, 3), 40))]
GIVEN = {
    "Mesh": {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1 / 3, 0]], "faces": [[0, 1, 2]], "uvs": [[0, 0], [1, 0], [0, 1]]},
    "PointCloud": {"points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.1], [0.5, 0.5, 0]], "radius": 0.8},
    "Polygon": {"outline": [[0, 0, 0], [3, 0, 0], [0, 3, 0]], "holes": [[[0.1, 0.1, 0], [1, 0.1, 0], [0.1, 1, 0]]]},
    "Implicit": {"expression": "x**2 + y**2 + z**2 - 1", "function": None},
    "Bitmap": {"image": np.linspace(0, 1, 24).reshape(2, 4, 3), "scale": (2, 0.5), "offset": (0.25, 0)},
    "EnvironmentLight": {"image": np.linspace(0, 1, 24).reshape(2, 4, 3), "transform": Transform.rotate((1, 2, 3), 40)},
    "ProjectorLight": {"image": np.linspace(0, 1, 300).reshape(10, 10, 3)},
    "SunSky": {"direction": (1, 0.1, 0.3)},
    "Subsurface": {"preset": "whole milk"},
    "Conductor": {"metal": "Cu"},
    "WindowCamera": {"left": -0.5, "bottom": -0.5},
    "Gradient": {"colors": [[0, 1, 0], [2, 0, 1 / 3], [0, 0, 0]], "places": [0, 0.1, 0.9], "end": 2.5},
    "SpectralColor": {"wavelengths": [400, 500.5, 700], "reflectances": [0.1, 1 / 3, 0.9]},
    "UvTransform": {"scale": (2, 1 / 3), "offset": (0.25, 0)},
    "MovingCamera": {"camera": FisheyeCamera(fov=150, readout=0.1), "poses": [(0, np.eye(4)), (1, {**AIM, "roll": 20})]},
    "Group": {"objects": [Sphere(radius=2)], "motion": MOTION},
    "Instance": {"of": Sphere(radius=3), "motion": MOTION},
}


def example(cls):
    """A member with as few default values as its checks allow."""
    values = {name: candidate(field) for name, field in cls.given.items()}
    values = {name: value for name, value in values.items() if value is not None} | GIVEN.get(cls.__name__, {})
    for _ in range(len(values) + 1):
        try:
            return cls(**values)
        except SceneError as error:
            named = str(error).removeprefix(f"{cls.__name__}.").split(":", 1)[0]
            if named not in values:
                raise
            del values[named]
    raise AssertionError(cls)


def in_scene(member):
    """A scene that holds a member somewhere."""
    match member.family:
        case "cameras":
            return Scene(camera=member)
        case "integrators":
            return Scene(integrator=member)
        case "materials":
            return Scene(Sphere(material=member))
        case "textures":
            return Scene(Sphere(material=Lambert(albedo=member)))
    return Scene(member)



ALL = [(family, name) for family in ("shapes", "materials", "textures", "lights", "cameras", "integrators", "scene")
       for name in sorted(members(family)) if name != "Scene"]  # fmt: skip


@pytest.mark.parametrize(("family", "name"), ALL)
def test_yaml_gives_back_every_member_field_by_field(family, name, tmp_path):
    scene = in_scene(example(members(family)[name]))
    save_scene(scene, tmp_path / "scene.yaml")
    assert_same(load_scene(tmp_path / "scene.yaml"), scene)


def test_yaml_gives_back_a_whole_scene_with_what_is_shared(tmp_path):
    rng = np.random.default_rng(1)
    picture = Bitmap(image=rng.random((16, 16, 3)), wrap="clamp")
    steel = Phong(diffuse=picture, mirror=0.3)
    large = Mesh(vertices=rng.random((200, 3)), faces=rng.permutation(198).reshape(-1, 3), name="a: b/c",
                 uvs=rng.random((200, 2)), normals=rng.random((200, 3)), material=steel)  # fmt: skip
    ball = Sphere(name="ball", material=steel)
    pair = Group(objects=[ball, Instance(of=ball, transform=Transform.translate(3, 0, 0))], name="ball")
    scene = Scene(large, pair, Instance(of=pair), Instance(of=ball, material=Glass()), background=(0.1, 0.2, 0.3),
                  camera=example(members("cameras")["PerspectiveCamera"]), samples=9, name="on", transfer="floor")
    save_scene(scene, tmp_path / "s.yaml")
    again = load_scene(tmp_path / "s.yaml")
    assert_same(again, scene)
    group = again.objects[1]
    assert again.objects[2].of is group
    assert again.objects[3].of is group.objects[0] is group.objects[1].of
    assert again.objects[0].material is group.objects[0].material
    assert {path.suffix for path in tmp_path.iterdir()} == {".yaml", ".ply", ".npy"}
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".sightray")]


def test_yaml_paths_are_relative_to_the_file(tmp_path):
    from sightray.images import Image

    (tmp_path / "textures").mkdir()
    (tmp_path / "scenes").mkdir()
    Image(np.full((2, 2, 3), 0.5)).save(tmp_path / "textures" / "grey.png")
    scene = Scene(Sphere(material=Lambert(albedo=Bitmap(image=tmp_path / "textures" / "grey.png"))))
    save_scene(scene, tmp_path / "scenes" / "s.yaml")
    assert "../textures/grey.png" in (tmp_path / "scenes" / "s.yaml").read_text()
    assert_same(load_scene(tmp_path / "scenes" / "s.yaml"), scene)


def test_yaml_saving_what_has_no_name_in_files_is_refused_and_leaves_nothing(tmp_path):
    from sightray._jit import kernel
    from sightray.mathlib.scalars import f64
    from sightray.shapes.implicit import Implicit

    @kernel
    def plane(x: f64, y: f64, z: f64) -> f64:
        return x

    with pytest.raises(SceneError, match=r"function.*cannot be written"):
        save_scene(Scene(Implicit(function=plane)), tmp_path / "s.yaml")
    assert not list(tmp_path.iterdir())


TEXT = """\
camera: {type: PerspectiveCamera, eye: [0, 1, 4], width: 64, height: 48}
integrator: Whitted
background: .5
materials:
  floor:
    type: Lambert
    albedo: [0.7, 0.6, 0.5]
objects:
  - type: Sphere
    radius: 1e-1
    material: floor
    transform:
      - translate: [1, 0, 0]
      - rotate: {axis: [0, 0, 1], degrees: 90}
      - scale: 2
  - {type: PointLight, position: [2, 4, 3], intensity: 60}
"""


def test_yaml_as_people_write_it(write):
    scene = load_scene(write("cornell.yaml", TEXT))
    ball = scene.objects[0]
    assert (scene.camera.width, scene.background, ball.radius) == (64, (0.5,) * 3, 0.1)
    assert np.allclose(ball.transform.point([0, 0, 0]), [0, 2, 0])  # steps happen in the order written
    assert ball.material.albedo == (0.7, 0.6, 0.5)
    assert load_scene(write("empty.yaml", "")).objects == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("albedo:", "albdo:", "7: materials.floor: unknown field 'albdo' for Lambert; did you mean 'albedo'? "
                              "Fields: albedo, emission"),
        ("albedo: [0.7, 0.6, 0.5]", "albedo: [0.7, 0.6]", "7: materials.floor: Lambert.albedo: got [0.7, 0.6]"),
        ("albedo: [0.7, 0.6, 0.5]", "albedo: 1.5", "7: materials.floor: Lambert.albedo: got 1.5"),
        ("type: Lambert", "type: Lamber", "6: materials.floor: unknown type 'Lamber'; did you mean 'Lambert'?"),
        ("    type: Lambert\n", "", "6: materials.floor: expected a mapping with 'type'"),
        ("radius: 1e-1", "radius: yes", "10: objects[0]: Sphere.radius: got 'yes'"),
        ("radius: 1e-1", "radius: .nan", "10: objects[0]: Sphere.radius: got nan"),
        ("material: floor", "material: flor", "11: no 'flor' in materials; did you mean 'floor'? Names: floor"),
        ("scale: 2", "scale: 0", "15: objects[0].transform.scale: singular transform"),
        ("scale: 2", "skale: 2", "15: objects[0].transform: unknown step 'skale'; did you mean 'scale'?"),
        ("degrees: 90", "degree: 90", "14: objects[0].transform.rotate: expected {axis"),
        ("background: .5", "backgruond: .5", "3: unknown key 'backgruond'; did you mean 'background'?"),
        ("background: .5", "background: -1", "3: scene: Scene.background: got -1"),
        ("background: .5", "camera: null", "3: key 'camera' a second time; first in line 1"),
        ("background: .5", "5: .5", "3: the key 5 is not a string"),
        ("background: .5", "? [a]\n: b", "3: the key a list or mapping is not a string"),
        ("background: .5", "background: !!python/object/apply:os.system [ls]", "3: tag"),
        ("background: .5", "background: *x", "3: alias '*x'; expected an anchor '&x' before it"),
        ("background: .5", "background: &x [*x]", "3: alias '*x'; expected an anchor '&x' before it"),
        ("background: .5", "background: [1, 2", "not YAML"),
        ("background: .5", "background: .5\n---\n", "4: a second document"),
        ("integrator: Whitted", "integrator: Whited", "2: integrator: unknown type 'Whited'; did you mean 'Whitted'?"),
        ("width: 64", "width: 1.5", "1: camera: PerspectiveCamera.width: got 1.5"),
        ("- type: Sphere", "- type: Mesh\n    file: ../etc/passwd", "10: file name '../etc/passwd': unknown suffix"),
        ("- type: Sphere", "- type: Mesh\n    file: /etc/x.ply", "10: file name '/etc/x.ply'; allowed: a path rel"),
    ],
)  # fmt: skip
def test_yaml_mistakes_are_named_with_line_and_place(write, old, new, message):
    assert old in TEXT
    path = write("cornell.yaml", TEXT.replace(old, new))
    with pytest.raises(FormatError) as caught:
        load_scene(path)
    assert f"{path}:{message}" in str(caught.value) or (message == "not YAML" and message in str(caught.value))


def test_yaml_bombs_nesting_and_cycles_are_refused(write):
    laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{i + 1}: &a{i + 1} [{', '.join([f'*a{i}'] * 9)}]\n" for i in range(20)
    )
    with pytest.raises(FormatError, match="counting aliases"):
        load_scene(write("bomb.yaml", laughs))
    with pytest.raises(FormatError, match="nested deeper than"):
        load_scene(write("deep.yaml", "objects: " + "[" * 100_000))
    with pytest.raises(FormatError, match=r"cyclic reference shapes\.a -> shapes\.b -> shapes\.a"):
        load_scene(write("cycle.yaml", "shapes:\n  a: {type: Instance, of: b}\n  b: {type: Group, objects: [a]}\n"))
    doubling = "shapes:\n  s0: {type: Sphere}\n" + "".join(
        f"  s{i + 1}: {{type: Group, objects: [s{i}, s{i}]}}\n" for i in range(50)
    )
    with pytest.raises(FormatError, match=r"shapes\.s\d+: more than 10000 members"):
        load_scene(write("doubling.yaml", doubling), max_nodes=10_000)
    with pytest.raises(FormatError, match="more than 10 values"):
        load_scene(write("many.yaml", f"objects: [{', '.join(['x'] * 20)}]"), max_nodes=10)


def test_yaml_mesh_files(write):
    write("two.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 3 2 1\n")
    write("one.stl", "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
                     "endfacet\nendsolid x\n")  # fmt: skip
    text = ("objects:\n- {type: Mesh, file: two.obj, name: pair, material: {type: Glass}}\n"
            "- {type: Mesh, file: one.stl, transform: [{scale: 2}]}\n")  # fmt: skip
    both, one = load_scene(write("s.yaml", text)).objects
    assert isinstance(both, Group)
    assert (both.name, len(both.objects)) == ("pair", 2)
    assert isinstance(both.objects[0].material, Glass)
    assert points(one).max() == 2
    with pytest.raises(FormatError, match=r":1: objects\[0\]: 'faces' beside 'file'"):
        load_scene(write("s.yaml", "objects: [{type: Mesh, file: one.stl, faces: []}]"))
    with pytest.raises(FormatError, match=r"none\.ply: no such file"):
        load_scene(write("s.yaml", "objects: [{type: Mesh, file: none.ply}]"))
