"""Broken files of every format: each loads, or ends in one of the three errors, soon."""

import json
import re
import signal
import time
import warnings

import format_examples
import numpy as np
import pytest
import trimesh
from format_examples import CUBE, image_with_a_light_top_left

from sightray.errors import FormatError, SceneError, UnsupportedError
from sightray.formats import load_scene, suffixes

write = format_examples.write

MUTATIONS = 300
SECONDS = 5  # for one file of a few hundred bytes; a second would do, but the machine may be busy
NUMBERS = [b"nan", b"inf", b"1e400", b"1e300", b"-1", b"0", b"99999999999999999999", b"1e-400", b"0.5", b"4294967295",
           b"x", b"[", b"*a", b"null"]  # fmt: skip

COURSE = b"""size 40 30
camera 0 0 4 0 0 0 0 1 0 30
maxdepth 3
ambient .1 .2 .3
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
vertexnormal 0 0 0 0 0 1
pushTransform
translate 1 2 3
rotate 0 0 1 45
scale 1 2 3
tri 0 1 2
trinormal 0 0 0
sphere 0 0 0 1
popTransform
point 0 4 0 1 1 1
directional 0 1 1 1 1 1
attenuation 1 0 0
quadLight 0 0 0 1 0 0 0 1 0 1 1 1
shininess 20
"""
YAML = b"""camera: {type: PerspectiveCamera, eye: [0, 1, 4], width: 64}
integrator: {type: Whitted, max_depth: 4}
materials:
  a: &m {type: Phong, diffuse: {type: Checker, even: 0.1}, mirror: 0.5}
  b: *m
shapes:
  ball: {type: Sphere, radius: 0.5, material: a}
  pair: {type: Group, objects: [ball, {type: Instance, of: ball, transform: [{translate: [1, 0, 0]}, {scale: 2}]}]}
objects:
- pair
- {type: Mesh, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces: [[0, 1, 2]]}
- {type: Mesh, file: "cube.ply", transform: {rotate: {axis: [1, 0, 0], degrees: 30}}}
- type: PointLight
  position: [1, 2, 3]
"""
OBJ = b"""mtllib m.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 1
vn 0 0 1
usemtl a
s 1
f 1/1/1 2/2/1 3/1/1 4/2/1
s off
f 1 2 -1
f -4//1 2//1 3//1
"""
MTL = b"newmtl a\nKd 1 0 0\nKs 1 1 1\nNs 20\nd 0.4\nNi 1.5\nillum 2\nmap_Kd p.png\nnewmtl b\nKe 1 1 1\n"
NFF = b"""b 0 0 0
v
from 0 0 5
at 0 0 0
up 0 1 0
angle 45
hither 1
resolution 10 10
l 1 2 3
f 1 1 1 .5 .5 10 0 1
p 4
0 0 0 1 0 0 1 1 0 0 1 0
pp 3
0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1
s 0 0 0 1
c 0 0 0 1 0 1 0 .5
"""
PLY_ASCII = b"""ply
format ascii 1.0
comment TextureFile p.png
element vertex 4
property float x
property float y
property float z
property float s
property float t
element face 2
property list uchar int vertex_indices
end_header
0 0 0 0 0
1 0 0 1 0
1 1 0 1 1
0 1 0 0 1
3 0 1 2
4 0 1 2 3
"""


def _big_endian():
    head, body = CUBE.export(file_type="ply").split(b"end_header\n", 1)
    n, m = len(CUBE.vertices), len(CUBE.faces)
    vertices = np.frombuffer(body, "<f4", 3 * n).astype(">f4").tobytes()
    faces = np.frombuffer(body, np.dtype([("n", "u1"), ("v", "<i4", 3)]), m, 12 * n)
    faces = faces.astype(np.dtype([("n", "u1"), ("v", ">i4", 3)])).tobytes()
    return head.replace(b"little", b"big") + b"end_header\n" + vertices + faces


def _gltf():
    """A glTF of one file: everything in data addresses."""
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene(CUBE), embed_buffers=True)
    return json.dumps(json.loads(files["model.gltf"])).encode()


SEEDS = {
    "course": ("a.test", COURSE), "yaml": ("a.yaml", YAML), "obj": ("a.obj", OBJ), "mtl": ("m.mtl", MTL),
    "nff": ("a.nff", NFF), "ply-ascii": ("a.ply", PLY_ASCII), "ply-little": ("a.ply", CUBE.export(file_type="ply")),
    "ply-big": ("a.ply", _big_endian()), "stl-ascii": ("a.stl", CUBE.export(file_type="stl_ascii").encode()),
    "stl-binary": ("a.stl", CUBE.export(file_type="stl")), "glb": ("a.glb", CUBE.export(file_type="glb")),
    "gltf": ("a.gltf", _gltf()), "sidecar": ("cube.ply", CUBE.export(file_type="ply")),
}  # fmt: skip
LOADED = {"mtl": "a.obj", "sidecar": "a.yaml"}  # what is loaded when the seed itself is only referred to


def mutate(data, rng):
    """The seed with one or two small accidents."""
    for _ in range(rng.integers(1, 3)):
        data = ACCIDENTS[rng.integers(len(ACCIDENTS))](bytearray(data), rng)
    return bytes(data)


def flip_bytes(data, rng):
    for at in rng.integers(0, max(1, len(data)), size=rng.integers(1, 6)):
        if data:
            data[at] = rng.integers(256)
    return data


def truncate(data, rng):
    return data[: rng.integers(0, len(data) + 1)]


def cut_out(data, rng):
    start = rng.integers(0, len(data) + 1)
    return data[:start] + data[start + rng.integers(0, 20) :]


def lose_or_repeat_a_line(data, rng):
    lines = bytes(data).split(b"\n")
    at = rng.integers(len(lines))
    lines[at : at + 1] = [lines[at]] * int(rng.choice([0, 2, 40]))
    return bytearray(b"\n".join(lines))


def replace_a_word(data, rng):
    words = bytes(data).split(b" ")
    words[rng.integers(len(words))] = NUMBERS[rng.integers(len(NUMBERS))]
    return bytearray(b" ".join(words))


def replace_a_number(data, rng):
    found = list(re.finditer(rb"[-+]?[0-9][0-9.eE+-]*", data))
    if not found:
        return data
    at = found[rng.integers(len(found))]
    return data[: at.start()] + NUMBERS[rng.integers(len(NUMBERS))] + data[at.end() :]


def change_a_digit(data, rng):
    """The length stays, so that what counts bytes goes on fitting."""
    found = [at for at, byte in enumerate(data) if 48 <= byte <= 57]
    if found:
        data[found[rng.integers(len(found))]] = 48 + rng.integers(10)
    return data


def replace_four_bytes(data, rng):
    at = rng.integers(0, max(1, len(data) - 4))
    data[at : at + 4] = rng.choice([0, 1, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FC00000]).astype("<u4").tobytes()
    return data


ACCIDENTS = [flip_bytes, truncate, cut_out, lose_or_repeat_a_line, replace_a_word, replace_a_number, replace_a_number,
             change_a_digit, change_a_digit, replace_four_bytes]  # fmt: skip


def load_in_time(path):
    """How a load ended: None, or its error; anything else is the test's failure. A hang is interrupted."""

    def late(*_):
        raise TimeoutError(f"{path} took more than {SECONDS} s")

    before = signal.signal(signal.SIGALRM, late) if hasattr(signal, "SIGALRM") else None
    start = time.monotonic()
    try:
        if before is not None:
            signal.alarm(SECONDS)
        load_scene(path)
    except (FormatError, SceneError, UnsupportedError) as error:
        ended = error
    else:
        ended = None
    finally:
        if before is not None:
            signal.alarm(0)
            signal.signal(signal.SIGALRM, before)
    assert time.monotonic() - start < SECONDS
    assert ended is None or (str(ended) and "TimeoutError" not in str(ended))
    return ended


@pytest.mark.parametrize("kind", SEEDS)
def test_broken_files_load_or_end_in_a_clear_error(kind, write, tmp_path):
    image_with_a_light_top_left(tmp_path / "p.png")
    for name, content in (("m.mtl", MTL), ("cube.ply", CUBE.export(file_type="ply")), ("a.obj", OBJ), ("a.yaml", YAML)):
        write(name, content)
    name, seed = SEEDS[kind]
    target = tmp_path / LOADED.get(kind, name)
    assert load_in_time(write(name, seed).parent / target.name) is None
    rng = np.random.default_rng(list(kind.encode()))
    failed = 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # triangles without area
        for _ in range(MUTATIONS):
            write(name, mutate(seed, rng))  # on failure the file is left to look at
            failed += load_in_time(target) is not None
    assert failed > 0


def test_every_format_is_attacked():
    attacked = {"." + name.rsplit(".")[1] for name, _ in SEEDS.values()}
    assert set(suffixes()) <= attacked | {".yml"}
