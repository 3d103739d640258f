"""Every medium against the law of Bouguer and Beer, Chandrasekhar's slab, and its own phase function."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

import sightray as sr
from sightray._jit import kernel, native
from sightray.errors import SceneError
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, no_table, vec3_at, vec3_put
from sightray.media.base import phase, sample_distance, sample_phase, transmittance
from sightray.media.grid import density_at
from sightray.media.henyey_greenstein import henyey_greenstein
from sightray.registry import members
from sightray.samplers.base import begin
from sightray.scene.compile import Tables

RNG = np.random.default_rng(4)
CLOUD = RNG.random((3, 4, 5))
TURN = sr.Transform.translate(0.2, -0.1, 0.4) @ sr.Transform.rotate((1, 2, 3), 40)
MEDIA = {
    "HomogeneousMedium": [
        sr.HomogeneousMedium(absorption=(0.1, 0.4, 1.0)),
        sr.HomogeneousMedium(absorption=(0.1, 0.0, 0.2), scattering=(0.5, 1.0, 2.0), g=0.5),
    ],
    "GridMedium": [
        sr.GridMedium(density=np.full((2, 2, 2), 1.5), lower=(-9, -9, -9), upper=(9, 9, 9), scattering=(0.4, 0.6, 1),
                      absorption=0.1, g=-0.3),
        sr.GridMedium(density=CLOUD, lower=(-1, -2, -1.5), upper=(1, 2, 1.5), transform=TURN, scattering=2, g=0.9),
    ],
}  # fmt: skip
EVERY = [pytest.param(m, id=f"{name}{k}") for name, some in MEDIA.items() for k, m in enumerate(some)]


@kernel
def ask_densities(medium: Table, places: Table, count: i64, found: Table) -> None:
    for i in range(count):
        f64_put(found, i, density_at(medium, vec3_at(places, 4 * i)))


def test_densities_are_blended_between_the_centres():
    """Against SciPy's interpolation on the same grid; beyond the outermost centres the border's value goes on."""
    grid = MEDIA["GridMedium"][1]
    size = np.array(CLOUD.shape[::-1])
    places = np.zeros((500, 4))
    places[:, :3] = np.random.default_rng(1).random((500, 3)) * size
    tables, found = Tables(), np.zeros(500)
    row = tables.row_of(grid)
    tables.prepare(ask_densities)
    native(ask_densities)(row, tables.space.array(places), 500, tables.space.array(found))
    expected = map_coordinates(CLOUD, places[:, 2::-1].T - 0.5, order=1, mode="nearest")
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_every_medium_has_an_example():
    own = {name for name, cls in members("media").items() if cls.__module__.startswith("sightray.")}
    assert set(MEDIA) == own


@kernel
def ask(medium: Table, sampler: Table, count: i64, ray: Table, answers: Table) -> None:
    """Distances, directions, transmittances: 16 words each."""
    o, d, t_max = vec3_at(ray, 0), vec3_at(ray, 4), f64_at(ray, 8)
    for i in range(count):
        draws = begin(sampler, i, 0, 1, 0, 1)
        went = sample_distance(medium, o, d, t_max, vec3_at(ray, 12), no_table(), draws)
        turned = sample_phase(medium, d, f64_at(ray, 16 + 2 * i), f64_at(ray, 17 + 2 * i))
        f64_put(answers, 16 * i, went.t)
        f64_put(answers, 16 * i + 1, 1.0 if went.scattered else 0.0)
        vec3_put(answers, 16 * i + 2, went.weight)
        vec3_put(answers, 16 * i + 6, turned.direction)
        f64_put(answers, 16 * i + 10, turned.density)
        f64_put(answers, 16 * i + 11, phase(medium, d.x * turned.direction.x + d.y * turned.direction.y
                                            + d.z * turned.direction.z))  # fmt: skip
        vec3_put(answers, 16 * i + 12, transmittance(medium, o, d, t_max, no_table(), draws))


def asked(medium, t_max, count, compiled=True, beta=(1.0, 1.0, 1.0)):
    tables = Tables()
    row, sampler = tables.row_of(medium), tables.row_of(sr.IndependentSampler())
    tables.prepare(ask, compiled=compiled)
    ray = np.zeros(16 + 2 * count)
    d = np.array([0.6, -0.64, 0.48])
    ray[:3], ray[4:7], ray[8] = -0.9 * d, d, t_max
    ray[12:15] = beta
    ray[16:] = np.random.default_rng(0).random(2 * count)
    out = np.zeros((count, 16))
    (native(ask) if compiled else ask)(row, sampler, count, tables.space.array(ray), tables.space.array(out))
    return out, ray


def beer(medium, t_max):
    """Transmittance of RGB by the law itself: a fine sum over the way."""
    total = np.add(medium.absorption, medium.scattering)
    if isinstance(medium, sr.HomogeneousMedium):
        return np.exp(-total * t_max)
    d = np.array([0.6, -0.64, 0.48])
    t = (np.arange(20_000) + 0.5) / 20_000 * t_max
    p = (-0.9 * d + t[:, None] * d) @ medium.to_grid()[:3, :3].T + medium.to_grid()[:3, 3]
    size = np.array(medium.density.shape[::-1])
    inside = ((p >= 0) & (p <= size)).all(1)
    q = np.clip(p - 0.5, 0, size - 1)  # blend between centres; beyond the outermost ones it is constant
    low = np.minimum(np.floor(q).astype(int), np.maximum(size - 2, 0))
    s = q - low
    density = np.zeros(len(t))
    for corner in np.ndindex(2, 2, 2):
        at = np.minimum(low + corner, size - 1)
        density += np.prod(np.where(corner, s, 1 - s), axis=1) * medium.density[at[:, 2], at[:, 1], at[:, 0]]
    return np.exp(-total * (density * inside).mean() * t_max)


@pytest.mark.parametrize("t_max", [0.7, 3.0])
@pytest.mark.parametrize("medium", EVERY)
def test_transmittance_is_bouguers_law(medium, t_max):
    out, _ = asked(medium, t_max, 20_000)
    left, error = out[:, 12:15].mean(0), out[:, 12:15].std(0) / math.sqrt(len(out))
    assert (np.abs(left - beer(medium, t_max)) <= 4.5 * error + 1e-6).all()


@pytest.mark.parametrize("beta", [(1.0, 1.0, 1.0), (0.2, 3.0, 0.01), (0.0, 0.0, 1.0)])
@pytest.mark.parametrize("t_max", [0.7, 3.0])
@pytest.mark.parametrize("medium", EVERY)
def test_distances_carry_the_right_weight(medium, t_max, beta):
    """What is not scattered weighs the transmittance; what is weighs the rest times the single scattering albedo."""
    out, _ = asked(medium, t_max, 40_000, beta=beta)
    lanes = np.array(beta) > 0  # one without weight may be missed
    scattered = out[:, 1:2] > 0
    passed, turned = np.where(scattered, 0, out[:, 2:5]), np.where(scattered, out[:, 2:5], 0)
    root = math.sqrt(len(out))
    assert (np.abs(passed.mean(0) - beer(medium, t_max)) <= 4.5 * passed.std(0) / root + 1e-6)[lanes].all()
    total = np.add(medium.absorption, medium.scattering)
    albedo = np.divide(medium.scattering, total, out=np.zeros(3), where=total > 0)
    if max(medium.scattering) > 0 and min(total) > 0:
        expected = (1 - beer(medium, t_max)) * albedo
        assert (np.abs(turned.mean(0) - expected) <= 4.5 * turned.std(0) / root + 1e-6)[lanes].all()
    assert (out[scattered[:, 0], 0] < t_max).all()


@pytest.mark.parametrize("medium", EVERY)
def test_directions_match_the_phase_function(medium):
    """Chi-square of the cosines against the integrals of the phase function; its mean cosine is g."""
    out, ray = asked(medium, 1.0, 40_000)
    np.testing.assert_allclose(out[:, 10], out[:, 11], rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(out[:, 6:9], axis=1), 1, rtol=1e-9)
    cosine = out[:, 6:9] @ ray[4:7]
    assert abs(cosine.mean() - medium.g) < 4.5 * cosine.std() / math.sqrt(len(out))
    edges = np.linspace(-1, 1, 21)
    fine = (np.arange(20_000) + 0.5) / 10_000 - 1
    mass = np.array([henyey_greenstein(medium.g, c) for c in fine]).reshape(20, -1).sum(1) * 2 * math.pi * 1e-4
    seen, _ = np.histogram(cosine, edges)
    big = mass * len(out) > 10
    statistic = ((seen - mass * len(out))[big] ** 2 / (mass * len(out))[big]).sum()
    assert statistic < big.sum() + 4 * math.sqrt(2 * big.sum()) + 8


@pytest.mark.parametrize(("g", "forward"), [(0.3, 0.2111239), (0.5, 0.4774648), (0.9, 15.1197196)])
def test_henyey_greenstein_numbers(g, forward):
    assert henyey_greenstein(g, 1.0) == pytest.approx(forward, rel=1e-6)


@pytest.mark.parametrize("medium", EVERY)
def test_machine_code_and_python_go_the_same_way(medium):
    np.testing.assert_allclose(
        asked(medium, 1.5, 40)[0], asked(medium, 1.5, 40, compiled=False)[0], rtol=1e-9, atol=1e-12
    )


def test_bad_grids_are_refused():
    with pytest.raises(sr.SceneError, match=r"\(nz, ny, nx\)"):
        sr.GridMedium(density=[[1, 2]])
    with pytest.raises(sr.SceneError, match="at least 0"):
        sr.GridMedium(density=-np.ones((1, 1, 1)))
    with pytest.raises(sr.SceneError, match="above lower"):
        sr.GridMedium(density=np.ones((1, 1, 1)), upper=(0, 1, 1))


# --- densities from files --------------------------------------------------------------------------------------------


def vol(densities, *, version=3, encoding=1, channels=1, size=None) -> bytes:
    """A volume as Mitsuba's manual describes the file."""
    nz, ny, nx = densities.shape
    head = b"VOL" + bytes([version]) + struct.pack("<5i6f", encoding, *(size or (nx, ny, nz)), channels, 0, 0, 0, 1, 1, 1)
    return head + np.asarray(densities, "<f4").tobytes()


def test_densities_from_files_are_those_of_the_array(tmp_path):
    densities = np.random.default_rng(1).random((3, 4, 5)).astype(np.float32)
    np.save(tmp_path / "smoke.npy", densities.astype(np.float64))
    (tmp_path / "smoke.vol").write_bytes(vol(densities))
    for name in ("smoke.npy", "smoke.vol"):
        np.testing.assert_array_equal(sr.GridMedium(density=tmp_path / name).density, densities)
        (tmp_path / "scene.yaml").write_text(
            f"medium: {{type: GridMedium, density: {name}}}\nobjects: [{{type: Sphere}}]\n"
        )
        scene = sr.load(tmp_path / "scene.yaml")
        np.testing.assert_array_equal(scene.medium.density, densities)
    large = scene.replace(medium=sr.GridMedium(density=np.tile(densities, (3, 3, 3))))
    (tmp_path / "saved").mkdir()
    sr.save(large, tmp_path / "saved" / "s.yaml")
    assert len((tmp_path / "saved" / "s.yaml").read_text()) < 600  # the grid stands beside it
    np.testing.assert_array_equal(sr.load(tmp_path / "saved" / "s.yaml").medium.density, large.medium.density)


@pytest.mark.parametrize(("name", "content", "words"), [
    ("smoke.vol", b"VOL\x03", "too short"),
    ("smoke.vol", vol(np.ones((2, 2, 2)))[:-1], "too short for 2 x 2 x 2"),
    ("smoke.vol", vol(np.ones((1, 1, 1)), size=(2**30, 2**30, 2**30)), "too short for"),
    ("smoke.vol", vol(np.ones((1, 1, 1)), size=(-1, -1, 1)), "too short for"),
    ("smoke.vol", vol(np.ones((2, 2, 2)), version=4), "version 3"),
    ("smoke.vol", vol(np.ones((2, 2, 2)), encoding=2), "encoding 2"),
    ("smoke.vol", vol(np.ones((2, 2, 2)), channels=3), "3 channels"),
    ("smoke.npy", b"\x93NUMPY", "smoke.npy"),
    ("smoke.npy", b"", "smoke.npy"),
    ("smoke.vdb", b"", "unknown suffix '.vdb'"),
    (None, b"", "No such file"),
])  # fmt: skip
def test_files_that_hold_no_densities_are_told(name, content, words, tmp_path):
    path = tmp_path / (name or "none.npy")
    if name is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError, match=words):
        sr.GridMedium(density=path)
