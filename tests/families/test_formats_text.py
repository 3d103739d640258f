"""The course format and NFF: each entity becomes what it means, mistakes are named with their line."""

import math

import format_examples
import numpy as np
import pytest
from format_examples import assert_same, points, shapes

import sightray as sr
from sightray.errors import FormatError, UnsupportedError
from sightray.formats import load_scene
from sightray.materials.glass import Glass
from sightray.materials.phong import Phong
from sightray.mathlib.transform import Transform

write = format_examples.write


HEAD = "size 40 30\ncamera 0 0 4 0 0 0 0 1 0 30\n"


def course(write, body, head=HEAD):
    return load_scene(write("a.test", head + body))


def test_course_image_and_camera(write):
    scene = course(write, "# a comment\n\noutput out.png\nmaxdepth 3\nspp 4\ncamera 1 2 3 0 0 0 0 0 +1 45\n")
    camera = scene.camera
    assert (camera.width, camera.height, camera.vfov) == (40, 30, 45)
    assert (camera.eye, camera.up) == ((1, 2, 3), (0, 0, 1))  # the last camera wins
    assert (scene.name, scene.samples, scene.transfer, scene.ambient) == ("out.png", 4, "floor", (1, 1, 1))
    assert (scene.integrator.max_depth, scene.integrator.two_sided, scene.integrator.cutoff) == (3, False, 0)
    assert course(write, "").integrator.max_depth == 5


def test_course_materials_are_captured_where_a_primitive_stands(write):
    first, second, third = shapes(course(write, "sphere 0 0 0 1\nambient .1 .2 .3\ndiffuse 1 0 0\nspecular 0 1 0\n"
                                         "emission 0 0 1\nshininess 7\nsphere 1 2 3 4\nsphere 0 0 0 1"))  # fmt: skip
    assert first.material.values() == Phong(diffuse=0, specular=0, ambient=0.2, shininess=0, highlight="blinn").values()
    assert second.material.values() == Phong(
        ambient=(0.1, 0.2, 0.3), diffuse=(1, 0, 0), specular=(0, 1, 0), mirror=(0, 1, 0), emission=(0, 0, 1),
        shininess=7, highlight="blinn",
    ).values()  # fmt: skip
    assert (second.center, second.radius) == ((1, 2, 3), 4)
    assert third.material is second.material


def test_course_triangles_are_baked_and_grouped_by_runs_of_equal_material(write):
    body = ("maxverts 1\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\ntri 0 1 2\ntranslate 0 0 5\ntri 0 1 2\n"
            "diffuse 1 0 0\ntri 0 1 2\ndiffuse 0 0 0\ntri 2 1 0\n")  # fmt: skip
    runs = shapes(course(write, body))
    assert [len(run.faces) for run in runs] == [2, 1, 1]
    base = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    raised = np.add(base, (0, 0, 5))
    assert (points(runs[0]) == [base, raised]).all()
    assert (points(runs[2])[0] == raised[::-1]).all()
    assert runs[0].material is runs[2].material is not runs[1].material
    assert all(run.transform.is_identity for run in runs)


def test_course_transforms_multiply_from_the_right_and_pop_restores(write):
    body = ("translate 1 2 3\npushTransform\nrotate 0 0 2 90\nscale 1 2 4\nsphere 0 0 0 1\n"
            "popTransform\nsphere 0 0 0 1\n")  # fmt: skip
    moved, plain = shapes(course(write, body))
    expected = Transform.translate(1, 2, 3) @ Transform.rotate((0, 0, 1), 90) @ Transform.scale(1, 2, 4)
    assert np.allclose(moved.transform.matrix, expected.matrix, atol=1e-15)
    assert np.allclose(moved.transform.point([0, 1, 0]), [-1, 2, 3], atol=1e-15)  # stretched to 2, then turned to -x
    assert (plain.transform.matrix == Transform.translate(1, 2, 3).matrix).all()


def test_course_trinormal_has_a_pile_of_its_own_and_normals_by_the_inverse_transpose(write):
    body = ("vertexnormal 0 0 0 0 0 2\nvertexnormal 1 0 0 1 0 1\nvertexnormal 0 1 0 0 1 1\nscale 2 1 1\n"
            "trinormal 0 1 2\n")  # fmt: skip
    (mesh,) = shapes(course(write, body))
    corner = {tuple(v): n for v, n in zip(mesh.vertices, mesh.normals, strict=True)}
    assert np.allclose(corner[0, 0, 0], [0, 0, 1])
    assert np.allclose(corner[2, 0, 0], np.array([0.5, 0, 1]) / math.hypot(0.5, 1))
    with pytest.raises(FormatError, match=r":4: tri: index 0; there are 0 vertices"):
        course(write, "vertexnormal 0 0 0 0 0 1\ntri 0 0 0\n")


def test_course_lights_stand_in_the_world(write):
    body = ("translate 9 9 9\npoint 1 2 3 4 5 6\nattenuation 1 2 3\npoint 0 0 0 1 1 1\ndirectional 0 0 2 .5 .5 1\n"
            "quadLight 0 0 0 1 0 0 0 0 1 3 3 3\n")  # fmt: skip
    plain, weak, sun, quad = course(write, body).lights
    assert (plain.position, plain.intensity, plain.attenuation) == ((1, 2, 3), (4, 5, 6), (1, 0, 0))
    assert weak.attenuation == (1, 2, 3)
    assert (sun.direction, sun.irradiance) == ((0, 0, -2), (0.5, 0.5, 1))  # the file says where the light comes from
    ab, ac = np.array([1, 0, 0]), np.array([0, 0, 1])
    assert np.dot(quad.area_vector(), -np.cross(ab, ac)) > 0


def test_course_flat_triangles_vanish_quietly(write):
    assert shapes(course(write, "vertex 0 0 0\nvertex 1 0 0\nvertex 2 0 0\ntri 0 1 2\n")) == []


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("spere 0 0 0 1", "unknown command 'spere'; did you mean 'sphere'?"),
        ("sphere 0 0 0", "sphere: got 3 numbers; expected 4"),
        ("vertex 0 x 0", "vertex: got 'x'; expected a finite number"),
        ("vertex 0 nan 0", "vertex: got 'nan'; expected a finite number"),
        ("vertex 0 1e999 0", "vertex: got '1e999'; expected a finite number"),
        ("tri 0 1 2", "tri: index 0; there are 0 vertices so far"),
        ("trinormal 0 1 2", "trinormal: index 0; there are 0 vertexnormals so far"),
        ("tri 0 .5 2", "tri: got '0.5'; expected a whole number"),
        ("tri -1 0 0", "tri: got -1; expected at least 0"),
        ("vertexnormal 0 0 0 0 0 0", "expected a direction"),
        ("popTransform", "popTransform without pushTransform"),
        ("diffuse 1 -1 0", "diffuse: got 1 -1 0; expected numbers >= 0"),
        ("sphere 0 0 0 -1", "Sphere.radius: got -1.0; allowed: a finite number > 0"),
        ("attenuation 0 0 0", "PointLight.attenuation"),
        ("rotate 0 0 0 10", "rotation axis"),
        ("size 0 10", "size: got 0; expected at least 1"),
        ("output", "output: expected a file name"),
        ("integrator raytracr", "unknown choice of integrator 'raytracr'; did you mean 'raytracer'?"),
    ],
)
def test_course_mistakes_are_named_with_their_line(write, line, message):
    with pytest.raises(FormatError) as caught:
        course(write, f"# fine\n{line}\n")
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{caught.value.path}:4: ")


def test_course_without_camera_or_with_an_impossible_one(write):
    with pytest.raises(FormatError, match=r"a\.test: no camera; expected a line 'camera"):
        course(write, "", head="size 4 4\n")
    with pytest.raises(FormatError, match=r":2: PerspectiveCamera: eye and target"):
        course(write, "", head="size 4 4\ncamera 1 1 1 1 1 1 0 1 0 30\n")


def test_course_continuation_chooses_integrators(write):
    assert isinstance(course(write, "lightsamples 5\nrussianroulette on\n").integrator, sr.Whitted)
    assert isinstance(course(write, "integrator analyticdirect\n").integrator, sr.AnalyticDirect)
    direct = course(write, "lightsamples 5\nmaxdepth -1\nintegrator direct\nspp 3\ngamma 2.2\n")
    assert repr(direct.integrator) == "DirectLighting(strategy='light', light_samples=5, max_depth=0)"
    assert (direct.samples, direct.transfer) == (3, "gamma2.2")
    walk = course(write, "integrator pathtracer\nnexteventestimation mis\nimportancesampling BRDF\nrussianroulette on\n"
                         "lightsamples 4\nmaxdepth -1\n").integrator  # fmt: skip
    assert walk.values() == {"next_event_estimation": "mis", "importance_sampling": "brdf", "russian_roulette": True,
                             "light_samples": 4, "max_depth": -1}  # fmt: skip
    assert repr(course(write, "integrator pathtracer\n").integrator) == "CoursePathTracer()"


def test_course_continuation_makes_materials_and_lights(write):
    body = ("quadLight 0 3 0 1 0 0 0 0 1 5 5 5\ndiffuse .1 .2 .3\nspecular .5 .5 .5\nshininess 9\nsphere 0 0 0 1\n"
            "brdf ggx\nroughness 0.3\nsphere 0 0 0 1\nlightsamples 9\nlightstratify {}\nintegrator {}\n")  # fmt: skip
    light, phong, ggx = course(write, body.format("on", "direct")).objects
    assert light.grid == 3
    assert light.area_vector().tolist() == [0, 1, 0]  # -(ab x ac), with ab = x and ac = z
    assert (phong.material.mirror, phong.material.shininess) == ((0, 0, 0), 9)
    assert (ggx.material.roughness, ggx.material.specular) == (0.3, (0.5, 0.5, 0.5))
    light, phong, ggx = course(write, body.format("off", "pathtracer")).objects
    assert light.grid == 1
    light, phong, ggx = course(write, body.format("off", "raytracer")).objects
    assert light.grid == sr.RectangleLight(corner=(0, 0, 0), edge_u=(1, 0, 0), edge_v=(0, 1, 0)).grid
    assert phong.material.mirror == (0.5, 0.5, 0.5)
    light, phong, ggx = course(write, body.format("off", "analyticdirect")).objects
    np.testing.assert_allclose(phong.material.diffuse, np.array([0.1, 0.2, 0.3]) / np.pi)
    assert phong.material is not ggx.material


@pytest.mark.parametrize(
    ("line", "error", "message"),
    [
        ("maxdepth -1", UnsupportedError, ":3: maxdepth -1; allowed for integrator raytracer: 0 to 200"),
        ("integrator pathtracer\nmaxdepth 1001", UnsupportedError, ":4: maxdepth 1001; allowed for integrator pathtracer"),
        ("gamma 1.8", UnsupportedError, ":3: gamma 1.8; allowed: 1 and 2.2"),
        ("lightsamples 0", FormatError, ":3: lightsamples: got 0; expected 1 to 4096"),
        ("lightsamples 2.5", FormatError, ":3: lightsamples"),
        ("roughness 0", FormatError, ":3: roughness: got 0; expected a number above 0, at most 1"),
        ("brdf", FormatError, ":3: brdf: got 0 words; expected 1"),
        ("lightstratify yes", FormatError, ":3: unknown choice of lightstratify 'yes'"),
        ("integrator direct\nlightstratify on\nlightsamples 5\nquadLight 0 3 0 1 0 0 0 0 1 5 5 5", FormatError,
         ":5: lightsamples: got 5; expected a square number"),
    ],
)  # fmt: skip
def test_course_continuation_mistakes(write, line, error, message):
    with pytest.raises(error) as caught:
        course(write, line)
    assert message in str(caught.value)


NFF = """\
# a room
b 0.1 0.2 0.3
v
from 0 0 5
at 0 0 0
up 0 1 0
angle 90
hither 1
resolution 100 100
l 1 2 3
l 4 5 6 .5 .25 1
f 1 .5 .25 .5 .2 10 0 0
p 4
-1 -1 0
1 -1 0
1 1 0
-1 1 0
p 3
0 0 1  1 0 1  0 1 1
pp 3
0 0 2 0 0 1
1 0 2 0 0 1
0 1 2 0 1 1
s 1 2 3 .5
f 1 1 1 0 0 0 .9 1.5
s 0 0 0 1
c
0 0 0 1
0 2 0 1
c
0 0 0 1
0 2 0 .5
"""


def test_nff_entities(write):
    scene = load_scene(write("a.nff", NFF))
    flat, smooth, ball, glass, tube, cone = shapes(scene)
    assert math.isclose(math.tan(math.radians(scene.camera.vfov / 2)), 100 / 99)  # the angle spans pixel centres
    assert scene.background == (0.1, 0.2, 0.3)
    assert [light.intensity for light in scene.lights] == [(1 / math.sqrt(2),) * 3, (0.5, 0.25, 1)]
    assert {light.attenuation for light in scene.lights} == {(1, 0, 0)}
    assert (len(flat.faces), flat.normals, len(smooth.faces)) == (3, None, 1)
    assert_same(ball.material, Phong(diffuse=(0.5, 0.25, 0.125), ambient=0, specular=(0.2, 0.1, 0.05), shininess=10,
                                     mirror=(0.2, 0.1, 0.05)))  # fmt: skip
    assert (ball.center, ball.radius) == ((1, 2, 3), 0.5)
    assert_same(glass.material, Glass(ior=1.5, tint=0.9))
    assert (tube.radius, tube.top, tube.capped) == (1, (0, 2, 0), False)
    assert (cone.base_radius, cone.top_radius, cone.capped) == (1, 0.5, False)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("b 0.1 0.2 0.3", "q 1", ":2: unknown entity 'q'"),
        ("s 1 2 3 .5", "s 1 2 x .5", ":24: sphere: got 'x'"),
        ("s 1 2 3 .5", "s 1 2 3 0", ":24: Sphere.radius"),
        ("p 4", "p 2", ":13: a polygon of 2 vertices"),
        ("p 4", "p 1e9", ":13: a polygon of 1e+09 vertices"),
        ("angle 90\n", "", ":3: viewpoint without 'angle'"),
        ("0 2 0 .5\n", "", ":30: cone or cylinder: the file ends; expected 8 numbers"),
    ],
)
def test_nff_mistakes_are_named_with_their_line(write, old, new, message):
    with pytest.raises(FormatError) as caught:
        load_scene(write("a.nff", NFF.replace(old, new)))
    assert message in str(caught.value)
    with pytest.raises(FormatError, match="no viewpoint"):
        load_scene(write("a.nff", "s 0 0 0 1\n"))
