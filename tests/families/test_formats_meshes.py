"""Mesh files: triangles, normals, texture coordinates and materials arrive as the file states them."""

import math
import struct

import format_examples
import numpy as np
import pytest
from format_examples import CUBE, assert_same, image_with_a_light_top_left, points, shapes

from sightray.errors import FormatError, UnsupportedError
from sightray.formats import load_scene
from sightray.formats.polygons import triangulate
from sightray.materials.glass import Glass
from sightray.materials.lambert import Lambert

write = format_examples.write




@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj", ".glb"])
def test_files_of_trimesh_give_its_triangles_in_its_order(tmp_path, suffix):
    path = tmp_path / f"cube{suffix}"
    CUBE.export(path)
    (mesh,) = shapes(load_scene(path))
    assert np.allclose(points(mesh), CUBE.triangles, atol=1e-6)


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_in_three_encodings_with_mixed_polygons_and_unknown_elements(write, order):
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 2, 0)]
    polygons = [(0, 1, 2, 3), (3, 2, 4)]
    header = (f"ply\nformat {order} 1.0\ncomment hello\nelement extra 2\nproperty list uchar short what\n"
              "element vertex 5\nproperty float x\nproperty float y\nproperty uchar red\nproperty double z\n"
              "element face 2\nproperty uchar flag\nproperty list uchar int vertex_indices\nend_header\n")  # fmt: skip
    if order == "ascii":
        rows = ["2 7 8", "0"] + [f"{x} {y} 9 {z}" for x, y, z in vertices]
        body = "\n".join(rows + [f"1 {len(p)} {' '.join(map(str, p))}" for p in polygons]).encode()
    else:
        e = "<" if "little" in order else ">"
        body = struct.pack(e + "BhhB", 2, 7, 8, 0)
        body += b"".join(struct.pack(e + "ffBd", x, y, 9, z) for x, y, z in vertices)
        body += b"".join(struct.pack(f"{e}BB{len(p)}i", 1, len(p), *p) for p in polygons)
    (mesh,) = shapes(load_scene(write("a.ply", header.encode() + body)))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 4]]
    assert np.allclose(mesh.vertices, vertices)


def test_ply_normals_and_both_kinds_of_texture_coordinates(write):
    head = "ply\nformat ascii 1.0\nelement vertex 3\n"
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz", "s", "t"))
    body = "0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 1\n"
    face = "element face 1\nproperty list uchar int vertex_index\n"
    (mesh,) = shapes(load_scene(write("a.ply", head + names + face + "end_header\n" + body + "3 0 1 2\n")))
    assert mesh.uvs.tolist() == [[0, 0], [1, 0], [0, 1]]
    assert mesh.normals.tolist() == [[0, 0, 1]] * 3
    wedge = face + "property list uchar float texcoord\nend_header\n"
    (mesh,) = shapes(load_scene(write("a.ply", head + names + wedge + body + "3 2 1 0 6 .1 .2 .3 .4 .5 .6\n")))
    assert np.allclose(mesh.uvs, [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])
    assert points(mesh)[0].tolist() == [[0, 1, 0], [1, 0, 0], [0, 0, 0]]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.ply", "ply\nformat ascii 1.0\n", "end_header"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 9999999\nproperty float x\nend_header\n1\n", "truncated"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 999999999999\nend_header\n1\n", "max_triangles"),
        ("a.ply", "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uint int v\nend_header\n"
                  "\xff\xff\xff\xff", "beyond the end"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty floaty x\nend_header\n1\n",
         ":4: unknown type 'floaty'; did you mean 'float'"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\nx\n",
         ":6: got 'x'; expected a number"),
        ("a.ply", "ply\nformat ascii 1.0\nproperty float x\nend_header\nx\n", ":3: 'property float x'"),
        ("a.stl", "solid\nfacet\nouter loop\nvertex 0 0\n", ":4: vertex: got 2 numbers; expected 3"),
        ("a.stl", "solid\nfacet\nouter loop\nvertex 0 0 0\nendfacet", ":5: facet of 1 vertices; expected 3"),
        ("a.stl", "solid vertex\nvertex 0 0 nan\n", ":2: vertex: got 'nan'"),
        ("a.stl", b"\0" * 80 + b"\xff\xff\xff\xff", "triangles"),
        ("a.stl", b"\0" * 80 + b"\x09\0\0\0", "truncated: 9 facets need 534 bytes, found 84"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", ":2: corner '2'; expected a vertex index from 1 to 1"),
        ("a.obj", "v 0 0 0\nv 0 0 1\nv 0 1 0\nf 1/1 2/1 3/1\n", "expected no texture coordinate, as the file has none"),
        ("a.obj", "v 0 0 0\nf 1 -2 1\n", ":2: corner '0'"),
        ("a.obj", "v 0 0\n", ":1: vertex: got 2 numbers; expected 3"),
        ("a.obj", "v 0 0 0\n\nf 1 1\n", ":3: face of 2 corners; expected at least 3"),
        ("a.obj", "vertex 0 0 0\n", ":1: 'vertex'; expected v, vt"),
        ("a.obj", "", "no faces"),
        ("a.obj", "mtllib /etc/passwd.mtl\n", ":1: file name '/etc/passwd.mtl'; allowed: a path relative"),
        ("a.glb", b"glTF\x02\0\0\0\x20\0\0\0\xff\xff\xff\x0fJSON", "truncated"),
        ("a.gltf", "{", "not JSON"),
        ("a.gltf", '{"asset": {"version": "1.0"}}', "glTF version 1.0"),
    ],
)  # fmt: skip
def test_broken_meshes_are_one_clear_message(write, name, content, message):
    path = write(name, content.encode("latin-1") if isinstance(content, str) else content)
    with pytest.raises((FormatError, UnsupportedError)) as caught:
        load_scene(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def test_obj_keeps_uvs_normals_relative_indices_and_line_numbers_of_joined_lines(write):
    text = ("v 0 0 0\nv 1 0 0\nv 1 1 0 # a comment\nv 0 1 0 1 1 1\nvt 0 0\nvt 1 0 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n"
            "f -4/-4/-1 2/2/1 \\\n3/3/1 -1/-1/-1\n")  # fmt: skip
    (mesh,) = shapes(load_scene(write("a.obj", text)))
    assert points(mesh).tolist() == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    assert (mesh.uvs == mesh.vertices[:, :2]).all()  # v upwards, as in the file
    assert (mesh.normals == [0, 0, 1]).all()
    with pytest.raises(FormatError, match=r":12: corner '99'"):
        load_scene(write("a.obj", text + "f 1 2 99\n"))


def test_obj_concave_polygons_and_smoothing_groups(write):
    arrow = "v 0 0 0\nv 2 -1 0\nv 0.5 0 0\nv 2 1 0\n"
    (mesh,) = shapes(load_scene(write("a.obj", arrow + "f 1 2 3 4\n")))
    a, b, c = np.moveaxis(points(mesh), 1, 0)
    assert np.cross(b - a, c - a)[:, 2].tolist() == [0.5, 0.5]
    roof = "v 0 0 0\nv 2 0 0\nv 2 1 1\nv 0 1 1\nv 2 2 0\nv 0 2 0\n"
    (mesh,) = shapes(load_scene(write("a.obj", roof + "s 1\nf 1 2 3 4\nf 4 3 5 6\n")))
    ridge = mesh.normals[(mesh.vertices[:, 2] == 1)]
    assert np.allclose(ridge / np.linalg.norm(ridge, axis=1)[:, None], [0, 0, 1])
    (mesh,) = shapes(load_scene(write("a.obj", roof + "s off\nf 1 2 3 4\nf 4 3 5 6\n")))
    assert mesh.normals is None


def test_triangulation_covers_concave_polygons_once():
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    star = np.stack([np.cos(angle), np.sin(angle), 0.3 * np.cos(angle)], axis=1)
    star[::2] *= 0.3
    for outline in (star, star[::-1]):
        a, b, c = (outline[triangulate(outline)[:, i]] for i in range(3))
        parts = np.cross(b - a, c - a)
        whole = np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0)
        assert len(a) == 38
        assert np.allclose(parts.sum(axis=0), whole)
        assert (parts @ whole > 0).all()


def test_mtl_becomes_lambert_phong_glass_and_bitmap(write, tmp_path):
    image_with_a_light_top_left(tmp_path / "a picture.png")
    write("m.mtl", "newmtl matte\nKd .5 .25 1\nKe 1 2 3\nnewmtl shiny\nKd 1 0 0\nKs .5 .5 .5\nNs 40\nillum 3\n"
                   "newmtl clear\nd 0.1\nNi 1.33\nillum 4\nnewmtl pic\nmap_Kd a picture.png\n"
                   "newmtl spec\nKd .1 .1 .1\nKs 1 1 1\nNs 0\n")  # fmt: skip
    names = ["matte", "shiny", "clear", "pic", "spec", "unknown"]
    faces = "".join(f"usemtl {name}\nf 1/1 2/2 3/3\n" for name in names)
    text = "mtllib ./m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
    found = {mesh.name: mesh.material for mesh in shapes(load_scene(write("a.obj", text + faces)))}
    assert list(found) == names
    assert_same(found["matte"], Lambert(albedo=(0.5, 0.25, 1), emission=(1, 2, 3)))
    assert_same(found["clear"], Glass(ior=1.33))
    assert_same(found["spec"], Lambert(albedo=0.1))
    assert found["unknown"] is None
    assert (found["shiny"].mirror, found["shiny"].shininess) == ((0.5,) * 3, 40)
    assert found["shiny"].diffuse == (1 / math.pi, 0, 0)
    assert found["pic"].albedo.pixels[0, 0].tolist() == [1, 1, 1]
    write("m.mtl", "newmtl lost\nKd 1 1 1\nmap_Kd gone.png\n")
    with pytest.raises(FormatError, match=r"m\.mtl:1: .*gone\.png: no such file"):
        load_scene(tmp_path / "a.obj")
    (tmp_path / "m.mtl").unlink()
    with pytest.warns(UserWarning, match=r"a\.obj:1: material library .*m\.mtl is missing"):
        load_scene(tmp_path / "a.obj")
    write("m.mtl", "newmtl matte\nKd x 0 0\n")
    with pytest.raises(FormatError, match=r"m\.mtl:2: Kd: got 'x'"):
        load_scene(tmp_path / "a.obj")
