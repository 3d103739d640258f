"""What the bench of pictures tells other renderers of our scenes, and what becomes of those that are not there."""

from __future__ import annotations

import json
import math
import sys

import numpy as np
import pytest

import sightray as sr
from sightray.cli import bench_cycles, bench_render
from sightray.cli.cycles_scene import FEW_LAMPS, TURN, write_cycles_scene
from sightray.errors import UnsupportedError


def written(scene, path, depth=4):
    write_cycles_scene(scene, depth, 2, path)
    arrays = dict(np.load(path))
    return json.loads(str(arrays.pop("told"))), arrays


def volume(vertices, faces):
    """By the divergence theorem; of triangles, or of faces of four split in two."""
    triangles = faces if faces.shape[1] == 3 else np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def test_cycles_gets_the_scene_as_it_is(tmp_path):
    glass = sr.Glass(ior=1.4)
    lamp = sr.RectangleLight(corner=(1, 3, 0), edge_u=(0, 0, 0.5), edge_v=(0.25, 0, 0), radiance=(4, 5, 6))
    scene = sr.Scene(
        sr.Box(lower=(-1, 0, -2), upper=(1, 3, 2), material=sr.Lambert(albedo=(0.1, 0.2, 0.3))),
        sr.Sphere(center=(0, 1, 0), radius=0.5, material=glass),
        sr.Sphere(center=(2, 1, 0), radius=0.25, material=glass),
        lamp,
        camera=sr.PerspectiveCamera(eye=(0, 1, 5), target=(0, 1, 0), vfov=40, width=20, height=10),
    )
    told, arrays = written(scene, tmp_path / "scene.npz")
    assert told["bounces"] == 3
    assert [m["kind"] for m in told["materials"]] == ["Lambert", "Glass", "Lambert"]  # the last is the lamp's back
    assert told["materials"][0]["color"] == [0.1, 0.2, 0.3]
    assert told["materials"][1]["ior"] == 1.4
    assert told["materials"][2]["color"] == [0, 0, 0]

    # Closed meshes face outward, and are as large as what they stand for.
    shapes = [(arrays[m["vertices"]], arrays[m["faces"]]) for m in told["meshes"]]
    assert volume(*shapes[0]) == pytest.approx(24)
    assert volume(*shapes[1]) == pytest.approx(4 / 3 * math.pi * 0.5**3, rel=1e-3)
    assert np.linalg.det(TURN[:3, :3]) == pytest.approx(1)

    # The lamp shines along -z of a right-handed frame in the middle of its rectangle; its back is a little behind.
    (light,) = told["lights"]
    pose = np.linalg.inv(TURN) @ light["pose"]
    np.testing.assert_allclose(pose[:3, 3], (1.125, 3, 0.25))
    np.testing.assert_allclose(-pose[:3, 2], lamp.area_vector() / lamp.area)
    np.testing.assert_allclose(pose[:3, :2] * (light["width"], light["height"]), np.transpose([lamp.edge_v, lamp.edge_u]))
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    behind = (shapes[3][0] - lamp.corner) @ (lamp.area_vector() / lamp.area)
    assert (behind < 0).all()
    assert (behind > -1e-3).all()

    # The camera looks along -z, y upwards.
    pose = np.linalg.inv(TURN) @ told["camera"]["pose"]
    np.testing.assert_allclose(pose[:3], [[1, 0, 0, 0], [0, 1, 0, 1], [0, 0, 1, 5]], atol=1e-12)


def test_many_lamps_are_surfaces_that_glow(tmp_path):
    """Each with its own colour, facing as the lamp does, and with a black back behind it."""
    rng = np.random.default_rng(2)
    lamps = [sr.RectangleLight(corner=rng.normal(size=3), edge_u=(0.1, 0, 0), edge_v=(0, 0.1, 0.1), radiance=rng.random(3))
             for _ in range(FEW_LAMPS + 1)]  # fmt: skip
    told, arrays = written(sr.Scene(*lamps, camera=sr.PerspectiveCamera()), tmp_path / "scene.npz")
    assert told["lights"] == []
    backs = arrays[told["meshes"][-1]["vertices"]].reshape(-1, 4, 3)
    assert told["materials"][told["meshes"][-1]["material"]]["color"] == [0, 0, 0]
    for k, lamp in enumerate(lamps):
        glow, corners = told["materials"][told["meshes"][k]["material"]], arrays[told["meshes"][k]["vertices"]]
        assert glow == {"kind": "Emitter", "color": list(lamp.radiance)}
        assert told["objects"][k] == {"mesh": k, "pose": TURN.tolist()}
        np.testing.assert_allclose(np.cross(corners[1] - corners[0], corners[3] - corners[0]), lamp.area_vector())
        np.testing.assert_allclose((backs[k] - corners) @ lamp.area_vector() / lamp.area, -2e-5)


def test_a_sky_is_seen_where_it_is(tmp_path):
    sky = np.random.default_rng(0).random((4, 8, 3), np.float32)
    scene = sr.Scene(sr.EnvironmentLight(image=sky, radiance=(2, 1, 1)), camera=sr.PerspectiveCamera())
    told, arrays = written(scene, tmp_path / "scene.npz")
    np.testing.assert_allclose(arrays[told["sky"]], sky * (2, 1, 1), rtol=1e-6)
    # Blender finds column W (1/2 - atan2(y, x) / 2 pi) in a direction; ours is W (1/2 + atan2(x, -z) / 2 pi).
    for d in np.random.default_rng(1).normal(size=(20, 3)):
        x, y, z = TURN[:3, :3] @ d
        assert -math.atan2(y, x) == pytest.approx(math.atan2(d[0], -d[2]))
        assert z == d[1]


@pytest.mark.parametrize(("thing", "word"), [
    (sr.Sphere(material=sr.Phong()), "Phong"), (sr.Cone(), "Cone"), (sr.PointLight(position=(0, 1, 0)), "PointLight"),
    (sr.Sphere(material=sr.Lambert(albedo=sr.Checker())), "Checker"),
])  # fmt: skip
def test_what_cycles_is_not_told_is_named(thing, word, tmp_path):
    with pytest.raises(UnsupportedError, match=word):
        write_cycles_scene(sr.Scene(thing, camera=sr.PerspectiveCamera()), 4, 2, tmp_path / "scene.npz")


@pytest.mark.parametrize(("program", "words"), [
    ("import json; print(json.dumps({'absent': 'bpy is not installed'}))", "bpy is not installed.*SIGHTRAY_PEER_PYTHON"),
    ("import sys; sys.exit('Error: out of luck')", "out of luck"),
])  # fmt: skip
def test_a_peer_that_is_not_there_is_a_row_that_says_so(program, words, tmp_path, monkeypatch):
    python = tmp_path / "python"
    python.write_text(f"#!{sys.executable}\n{program}\n")
    python.chmod(0o755)
    with pytest.raises(RuntimeError, match=words):
        bench_cycles.Cycles(bench_render.bench_scene("cornell", 8), 2, 1, str(python))
    monkeypatch.setenv(bench_cycles.PYTHON, str(python))
    monkeypatch.setattr(bench_render, "PEERS", {"Cycles": bench_render.cycles_renderer})
    monkeypatch.setattr(bench_render, "SIDE", 8)
    monkeypatch.setattr(bench_render, "SAMPLES", (1, 2))
    monkeypatch.setattr(bench_render, "REFERENCE", 4)
    *ours, theirs = bench_render.race("cornell", True, 1, None, rounds=1)
    assert [row.renderer for row in ours] == [
        "sightray", "sightray, adaptive", "sightray, shared", "sightray, shared, adaptive"
    ]  # fmt: skip
    assert theirs.renderer == "Cycles"
    assert theirs.absent


@pytest.mark.peers
@pytest.mark.parametrize("name", bench_render.SCENES)
@pytest.mark.parametrize("peer", sorted(bench_render.PEERS))
def test_peers_render_the_same_picture(peer, name):
    """In the mean of all, and of blocks; Cycles needs `bpy`, or a Python that has it in SIGHTRAY_PEER_PYTHON."""
    scene = bench_render.bench_scene(name, 48)
    theirs = bench_render.PEERS[peer](scene, 2).render(1024, 0)
    ours = bench_render.sightray_renderers(scene, 2)[0].render(1024, 0)
    assert theirs.mean() == pytest.approx(ours.mean(), rel=4e-3)
    height, width = (side // 8 * 8 for side in ours.shape[:2])
    blocks = [p[:height, :width].reshape(height // 8, 8, width // 8, 8, 3).mean((1, 3)) for p in (theirs, ours)]
    np.testing.assert_allclose(blocks[0], blocks[1], rtol=0.1, atol=0.01)
