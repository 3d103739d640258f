"""What the benches of rays trace, whom they compare, and what they say of it."""

from __future__ import annotations

import json
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

import sightray as sr
from sightray.cli import bench_cases, bench_rays, bench_scaling
from sightray.cli.bench_cases import Case
from sightray.cli.bench_peers import Tracer, Unable, open3d_tracer, plain_mesh
from sightray.cli.charts import Chart, short, steps, svg


def norm(a):
    return np.linalg.norm(a, axis=-1)


@pytest.fixture(scope="module")
def small():
    return bench_cases.mesh_case("small", *bench_cases.torus_mesh(2000), pixels=64)


# --------------------------------------------------------------------------------------------------------------- cases


def test_meshes_are_what_they_say():
    assert len(bench_cases.balls_mesh()[1]) == 527_362
    for wanted in (1000, 16_000, 1_000_000):
        vertices, faces = bench_cases.torus_mesh(wanted)
        assert abs(len(faces) / wanted - 1) < 0.02
        if wanted < 1e5:
            torus = trimesh.Trimesh(vertices, faces, process=False)
            assert torus.is_watertight
            assert torus.euler_number == 0
            assert torus.volume > 0  # normals face outward
    v, f = bench_cases.thin_mesh(1000)
    edges = np.sort(norm(v[f] - v[np.roll(f, 1, axis=1)]), axis=1)
    assert (edges[:, 2] / edges[:, 0] > 400).all()
    v, f = bench_cases.icosphere(3)
    assert (len(v), len(f)) == (642, 1280)
    np.testing.assert_allclose(norm(v), 1)
    assert trimesh.Trimesh(v, f, process=False).volume == pytest.approx(4 / 3 * np.pi, rel=0.02)


def test_rays_of_a_camera_and_of_what_it_sees(small):
    o, d = small.rays["coherent"]
    assert o.shape == d.shape == (64 * 64, 3)
    assert o.dtype == d.dtype == np.float32
    np.testing.assert_allclose(norm(d), 1, atol=1e-6)
    assert len(np.unique(d, axis=0)) == len(d)
    tiles = d.reshape(-1, 64, 3)
    assert norm(tiles - tiles.mean(axis=1, keepdims=True)).max() < 0.1  # neighbours of a tile stand together
    seen = small.scene.intersect(o, d)
    assert 0.1 < seen.hit.mean() < 0.9
    p, w = small.rays["diffuse"]
    assert len(p) == seen.hit.sum()
    n = seen.normal[seen.hit]
    above = ((p - seen.position[seen.hit]) * n).sum(axis=1)
    assert (above > 0).all()  # seen from outside
    cosine = (w * n).sum(axis=1)
    assert (cosine > -1e-6).all()
    assert abs(cosine.mean() - 2 / 3) < 4 * cosine.std() / np.sqrt(len(cosine))  # of cosines spread by the cosine
    assert small.scene.intersect(p, w).hit.mean() < 0.6


def test_instances_are_the_mesh_in_its_places():
    case = bench_cases.instances(6)
    v, f = case.mesh
    copies = [(trimesh.transform_points(v, place), f) for place in case.places]
    flat = sr.Scene(*[sr.Mesh(vertices=w, faces=g) for w, g in copies])
    rng = np.random.default_rng(1)
    d = case.places[rng.integers(0, 6, 3000), :3, 3] + 0.1 * rng.normal(size=(3000, 3)) - (0, 0, 20)
    a, b = case.scene.intersect((0, 0, 20), d), flat.intersect((0, 0, 20), d)
    assert a.hit.mean() > 0.5
    np.testing.assert_array_equal(a.shape, b.shape)
    np.testing.assert_allclose(a.t, b.t, rtol=1e-6)


def test_spheres_are_those_of_the_table():
    case = bench_cases.spheres(40)
    c, r = case.spheres[:, :3], case.spheres[:, 3]
    hits = case.scene.intersect(c + np.array([0, 0, 30]), (0, 0, -1))
    near = np.where(norm(c[:, None, :2] - c[:, :2]) < r, 30 - c[:, 2] + c[:, 2:], np.inf)
    assert hits.hit.all()
    np.testing.assert_array_less(hits.t, 30)
    np.testing.assert_allclose(hits.t[np.isfinite(near).sum(axis=1) == 1], (30 - r)[np.isfinite(near).sum(axis=1) == 1])


def test_adversarial_rays():
    case = bench_cases.adversarial()
    zeros, surface, far = (case.rays[kind] for kind in ("zeros", "from surface", "from 1e6"))
    assert set(np.unique((zeros[1] == 0).sum(axis=1))) == {1, 2}
    assert (norm(far[0].astype(float)) > 9e5).all()
    assert case.scene.intersect(*far).hit.mean() > 0.99  # aimed at corners, within some centimetres
    near = case.scene.closest_point(surface[0][:500]).distance
    assert 0 < near.max() < 1e-5


def test_meshes_of_files_and_scenes(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.export(tmp_path / "ball.ply")
    vertices, faces = bench_cases.meshes_of(str(tmp_path / "ball.ply"))
    assert (len(vertices), len(faces)) == (42, 80)
    _, faces = bench_cases.meshes_of("teapot-in-stadium")
    assert len(faces) > 50_000
    with pytest.raises(sr.SceneError, match="--case: unknown case 'balsl'; did you mean 'balls'"):
        bench_cases.case_named("balsl")
    with pytest.raises(sr.SceneError, match="--case: whitted: no meshes in it; allowed: "):
        bench_cases.case_named("whitted")


# ----------------------------------------------------------------------------------------------------------- measuring


def test_tracers_are_compared_and_absent_ones_named(small, monkeypatch, capsys):
    def liar(case, threads):
        """Says that the second half of rays miss."""

        def closest(o, d):
            t = case.scene.intersect(o, d).t
            t[len(t) // 2 :] = 1e37
            return t, t

        return Tracer("liar", closest, case.scene.occluded)

    def unable(case, threads):
        raise Unable("no tori")

    def missing(case, threads):
        raise ModuleNotFoundError("No module named 'missing'")

    monkeypatch.setattr(bench_rays, "PEERS", {"liar": liar, "unable": unable, "missing": missing})
    outcome = bench_rays.measure(small, True, 1, rounds=1)
    ours, theirs, cannot, gone = outcome.results
    assert outcome.questions == ["coherent closest", "diffuse closest", "coherent any", "diffuse any"]
    assert list(ours.rates) == list(theirs.rates) == outcome.questions
    assert min(ours.rates.values()) > 0
    assert ours.build > 0
    assert ours.agree == {"coherent": 1.0, "diffuse": 1.0}
    hit = small.scene.intersect(*small.rays["coherent"]).hit
    assert theirs.agree["coherent"] == pytest.approx(1 - hit[len(hit) // 2 :].mean() / 2)
    assert theirs.agree["coherent"] < 0.95
    assert (cannot.absent, gone.absent) == ("cannot: no tori", "ModuleNotFoundError: No module named 'missing'")
    assert outcome.facts["triangles"] == len(small.mesh[1])
    bench_rays.print_rates(outcome)
    told = capsys.readouterr().out
    for words in ("small", "liar", "cannot: no tori", "No module named 'missing'", "(1.00)", "million triangles built"):
        assert words in told
    assert json.loads(json.dumps(bench_rays.as_plain(outcome)))["tracers"][2]["absent"] == "cannot: no tori"


def test_whoever_is_measured_has_been_at_work_for_a_while(small, monkeypatch):
    """So long that threads of others, which wait in circles when they are done, have gone to sleep."""
    now, calls, ages = [0.0], [], {"first": 0.02, "second": 0.3}
    monkeypatch.setattr(bench_rays.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(bench_rays, "built", lambda make, case, threads: (make(case, threads), 1.0))

    def tracer(name):
        def call(o, d):
            calls.append(name)
            now[0] += ages[name] + (0.01 if calls[-2:-1] != [name] else 0.0)  # after another one it takes longer
            return small.scene.intersect(o, d).t, None

        return lambda case, threads: Tracer(name, call, call)

    monkeypatch.setattr(bench_rays, "sightray_tracer", tracer("first"))
    monkeypatch.setattr(bench_rays, "PEERS", {"second": tracer("second")})
    first, second = bench_rays.measure(small, True, 1, rounds=3).results
    for result in (first, second):
        for kind in small.rays:
            wanted = len(small.rays[kind][0]) / 1e6 / ages[result.name]
            assert result.rates[f"{kind} closest"] == pytest.approx(wanted)
    assert bench_rays.SETTLING == 0.05
    assert calls[:6] == ["first", "first", "first", "second", "second", "first"]


def test_bytes_of_a_triangle(small):
    facts = bench_rays.facts_of(small)
    tree = small.scene.objects[0].tree()
    each = (tree.tree.nodes.nbytes + tree.blocks.nbytes + tree.numbers.nbytes) / len(tree.faces)
    assert facts["bytes each triangle, tree and blocks"] == pytest.approx(each, abs=0.05)
    whole = facts["bytes each triangle, with vertices and faces"]
    assert whole - each == pytest.approx((tree.vertices.nbytes + tree.faces.nbytes) / len(tree.faces), abs=0.1)


def test_who_can_show_what():
    mesh, places = bench_cases.torus_mesh(1000), np.eye(4)[None]
    with pytest.raises(Unable, match="no instances"):
        plain_mesh(Case("a", None, {}, mesh, places))
    with pytest.raises(Unable, match="no spheres"):
        plain_mesh(Case("a", None, {}, spheres=np.zeros((1, 4))))
    assert plain_mesh(Case("a", None, {}, mesh)) is mesh


@pytest.mark.peers
def test_open3d_agrees(small):
    tracer = open3d_tracer(small, 1)
    for o, d in small.rays.values():
        np.testing.assert_allclose(tracer.closest(o, d)[0], small.scene.intersect(o, d).t, rtol=1e-3)


def test_command_line(tmp_path):
    def run(*arguments):
        command = [sys.executable, "-m", "sightray", "bench", *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=120)

    wrong = run("rays", "--case", "milion")
    assert wrong.returncode == 2
    assert "unknown case 'milion'; did you mean 'million'" in wrong.stderr
    assert "Traceback" not in wrong.stderr
    trimesh.creation.icosphere(subdivisions=2).export(tmp_path / "ball.stl")
    right = run("rays", "--case", str(tmp_path / "ball.stl"), "--rounds", "1", "--threads", "1", "--json")
    found = json.loads(right.stdout)
    assert [case["case"] for case in found] == ["ball.stl"]
    assert found[0]["tracers"][0]["name"] == "sightray"
    assert (found[0]["facts"]["triangles"], found[0]["facts"]["threads"]) == (320, 1)


# ------------------------------------------------------------------------------------------------------------- scaling


def test_fit_and_efficiency():
    rows = [bench_scaling.Row(n, 5 + 3 * np.log2(n), 7.0) for n in (1000, 4000, 64_000)]
    fit = bench_scaling.fitted(rows, "coherent")
    assert fit == pytest.approx((5, 3, 1))
    assert bench_scaling.fitted([rows[0]], "diffuse") == (7, 0, 1)
    noisy = [row._replace(coherent=row.coherent + e) for row, e in zip(rows, (4, -4, 2), strict=True)]
    assert 0.3 < bench_scaling.fitted(noisy, "coherent").explained < 0.95
    one, two = bench_scaling.Row(1, 40, 100, processor=(40, 100)), bench_scaling.Row(2, 25, 50, processor=(50, 80))
    assert bench_scaling.efficiency([one, two], two) == pytest.approx([0.8, 1, 0.8, 1.25])


def test_scaling_prints_and_draws(monkeypatch, capsys, tmp_path):
    rows = bench_scaling.over_triangles(4000, 1)
    assert [round(row.x, -3) for row in rows] == [1000, 4000]
    assert all(row.coherent > 0 < row.diffuse and row.build > 0 for row in rows)
    monkeypatch.setattr(bench_scaling, "over_threads", lambda most, rounds: [bench_scaling.Row(1, 40.0, 100.0)])
    monkeypatch.setattr(bench_scaling, "over_pixels", lambda rounds: [bench_scaling.Row(64, 9.0, 8.0), rows[1]])
    bench_scaling.scaling(False, tmp_path / "plot.svg", 4000, 1)
    told = capsys.readouterr().out
    for words in ("threads", "efficiency", "triangles", "log2 n", "pixels"):
        assert words in told
    assert (tmp_path / "plot.svg").read_text().count("<g ") == 3
    bench_scaling.scaling(True, None, 1000, 1)
    found = json.loads(capsys.readouterr().out)
    assert found["threads"] == [{"x": 1, "coherent": 40.0, "diffuse": 100.0, "build": 0.0, "processor": [0, 0]}]
    assert set(found["fit"]["coherent"]) == {"a", "b", "explained"}


def test_charts_are_svg_with_the_points_where_they_belong():
    chart = Chart("a < b & c", "n", "ns", {"x": [(1000, 0.0), (10_000, 5.0), (100_000, 10.0)]}, log=True)
    root = ElementTree.fromstring(svg([chart, chart]))
    space = {"s": "http://www.w3.org/2000/svg"}
    assert "a < b & c" in [t.text for t in root.findall(".//s:text", space)]
    groups = root.findall("s:g", space)
    assert len(groups) == 2
    dots = np.array([[float(c.get(k)) for k in ("cx", "cy")] for c in groups[0].findall("s:circle", space)])
    assert np.ptp(np.diff(dots, axis=0), axis=0).max() <= 0.2  # evenly spaced, in logarithms
    assert dots[0, 1] > dots[2, 1]  # larger is higher
    assert [short(x) for x in (0.25, 64, 990, 999_696, 4_000_206)] == ["0.25", "64", "990", "1M", "4M"]
    assert (steps(10.0), steps(9.9)) == ([0, 2, 4, 6, 8, 10], [0, 2, 4, 6, 8, 10])
    assert [steps(h)[-1] for h in (0.37, 41, 1.2e6)] == pytest.approx([0.4, 50, 1.25e6], rel=0.21)
