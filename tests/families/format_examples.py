"""What the tests of scene files share."""


import numpy as np
import pytest
import trimesh

from sightray.lights.base import Light
from sightray.mathlib.transform import Transform
from sightray.registry import Member

CUBE = trimesh.creation.box(extents=(2, 4, 6))


@pytest.fixture
def write(tmp_path):
    """A function that writes a file and gives its path."""

    def put(name, content):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return put


def shapes(scene):
    return [part for part in scene.objects if not isinstance(part, Light)]


def points(mesh):
    """Corners of all triangles, (n, 3, 3)."""
    return mesh.transform.point(mesh.vertices)[mesh.faces]


def assert_same(a, b):
    assert type(a) is type(b)
    if isinstance(a, Member):
        for name, value in a.values().items():
            assert_same(value, b.values()[name])
    elif isinstance(a, tuple | list):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype
        assert np.array_equal(a, b)
    elif isinstance(a, Transform):
        assert (a.matrix == b.matrix).all()
    else:
        assert a == b


def image_with_a_light_top_left(path):
    from PIL import Image

    pixels = np.zeros((4, 4, 3), np.uint8)
    pixels[0, 0] = 255
    Image.fromarray(pixels).save(path)
