"""Materials around materials, and what is inside of bodies: relief, holes, sides, media."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sightray as sr
from sightray._jit import kernel, native
from sightray.errors import SceneError
from sightray.materials.base import Way, bent_normal, emitted, interior, opacity
from sightray.materials.stored import stored
from sightray.materials.subsurface import PRESETS
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_put, is_null, vec3_put
from sightray.mathlib.vec import Vec3
from sightray.scene.compile import Tables
from sightray.textures.base import anywhere

FOG = sr.HomogeneousMedium(scattering=2)


@kernel
def ask_rest(material: Table, u: f64, v: f64, cos_view: f64, stretch: f64, out: Table) -> None:
    where = anywhere(u, v, Vec3(0.0, 0.0, 0.0))
    way = Way(stretch, Vec3(stretch, 0.0, 0.0), Vec3(0.0, stretch, 0.0))
    vec3_put(out, 0, bent_normal(material, where, way))
    f64_put(out, 4, opacity(material, where))
    f64_put(out, 5, 0.0 if is_null(interior(material)) else 1.0)
    vec3_put(out, 8, emitted(material, where, cos_view))


def rest_of(material, u=0.3, v=0.4, cos_view=1.0, stretch=1.0):
    """Bent normal, opacity, whether something is inside, and emission."""
    tables, out = Tables(), np.zeros(12)
    row = tables.row_of(material)
    tables.prepare(ask_rest)
    native(ask_rest)(row, u, v, cos_view, stretch, tables.space.array(out))
    return out[:3], out[4], bool(out[5]), out[8:11]


def colour_of(n):
    """The colour of a normal in a map."""
    return tuple(0.5 + 0.5 * np.asarray(n))


def unit(*v):
    return np.array(v) / np.linalg.norm(v)


def test_normal_maps():
    plain = sr.Lambert()
    assert rest_of(sr.NormalMap(material=plain, map=(0.5, 0.5, 1)))[0].tolist() == [0, 0, 1]
    n = unit(0.3, -0.5, 0.8)
    np.testing.assert_allclose(rest_of(sr.NormalMap(material=plain, map=colour_of(n)))[0], n, atol=1e-15)
    doubled = sr.NormalMap(material=plain, map=colour_of(n), strength=2)
    np.testing.assert_allclose(rest_of(doubled)[0], unit(0.6, -1, 0.8), atol=1e-15)


def test_relief_on_relief_adds_its_angles():
    tilt = sr.NormalMap(material=sr.Mirror(), map=colour_of((math.sin(0.3), 0, math.cos(0.3))))
    twice = sr.NormalMap(material=tilt, map=colour_of((math.sin(0.2), 0, math.cos(0.2))))
    np.testing.assert_allclose(rest_of(twice)[0], [math.sin(0.5), 0, math.cos(0.5)], atol=1e-12)


@pytest.mark.parametrize("stretch", [1.0, 4.0])
def test_bumps_are_slopes_of_heights(stretch):
    """Heights of 3 u - v, in units of 0.1 m, on a surface of `stretch` metres per unit: the normal of that plane."""
    u, v = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(64)[::-1] + 0.5) / 64)
    bump = sr.BumpMap(material=sr.Lambert(), height=sr.Bitmap(image=1 + 3 * u - v), scale=0.1)
    expected = unit(-0.3 / stretch, 0.1 / stretch, 1)
    np.testing.assert_allclose(rest_of(bump, stretch=stretch)[0], expected, atol=1e-5)


def test_relief_faces_the_right_way():
    """A normal tilted towards +u, or heights that rise with -u, is brighter when light comes from +u."""
    flat = sr.Rectangle(corner=(-1, 0, 1), edge_u=(2, 0, 0), edge_v=(0, 0, -2))  # u along +x, v along -z, normal +y
    matte = sr.Lambert(albedo=0.8)
    ramp = sr.Bitmap(image=np.linspace(1, 0, 256)[np.newaxis].repeat(4, 0))
    reliefs = [matte, sr.NormalMap(material=matte, map=colour_of(unit(0.3, 0, 1))),
               sr.BumpMap(material=matte, height=ramp, scale=0.6)]  # fmt: skip
    seen = {}
    for side in (1, -1):
        for axis in ("x", "z"):
            position = (5 * side, 5, 0) if axis == "x" else (0, 5, -5 * side)
            for k, material in enumerate(reliefs):
                scene = sr.Scene(flat.replace(material=material), sr.PointLight(position=position, intensity=50),
                                 camera=sr.OrthographicCamera(eye=(0, 4, 0), target=(0, 0, 0), up=(0, 0, -1), width=3,
                                                              height=3, view_height=0.5))  # fmt: skip
                seen[side, axis, k] = np.asarray(sr.render(scene, sr.Whitted(), samples=1)).mean()
    expected = (unit(0.3, 0, 1) @ unit(1, 0, 1)) / math.sqrt(0.5)
    for k in (1, 2):
        assert seen[1, "x", k] == pytest.approx(seen[1, "x", 0] * expected, rel=1e-3)
        assert seen[-1, "x", k] < 0.8 * seen[-1, "x", 0]
        assert seen[1, "z", k] == pytest.approx(seen[-1, "z", k], rel=1e-3)


def test_holes():
    lace = sr.Cutout(material=sr.Lambert(), opacity=sr.Checker(even=0.75, odd=0.25, scale=2))
    assert [rest_of(lace, u=u, v=0.1)[1] for u in (0.1, 0.6)] == [0.75, 0.25]
    assert [rest_of(lace.replace(threshold=0.5), u=u, v=0.1)[1] for u in (0.1, 0.6)] == [1, 0]
    assert rest_of(sr.Cutout(material=lace, opacity=0.5), u=0.1, v=0.1)[1] == 0.375
    assert rest_of(sr.Mix(a=lace, b=sr.Lambert(), amount=0.5), u=0.1, v=0.1)[1] == 0.875


def test_holes_let_light_through():
    """A black sheet with an opacity of 0.3 before a background of 1."""
    sheet = sr.Rectangle(corner=(-9, -9, 0), edge_u=(18, 0, 0), edge_v=(0, 18, 0),
                         material=sr.Cutout(material=sr.Lambert(albedo=0), opacity=0.3))  # fmt: skip
    camera = sr.PerspectiveCamera(eye=(0, 0, 5), width=32, height=32)
    image = np.asarray(sr.render(sr.Scene(sheet, background=1, camera=camera), sr.PathTracer(), samples=16))
    assert image.mean() == pytest.approx(0.7, abs=0.02)


def test_a_boundary_alone_is_not_seen():
    ball = sr.Sphere(radius=0.5, material=sr.Boundary(interior=sr.HomogeneousMedium()))
    wall = sr.Rectangle(corner=(-2, -2, -2), edge_u=(4, 0, 0), edge_v=(0, 4, 0), material=sr.Lambert(emission=(1, 2, 3)))
    camera = sr.PerspectiveCamera(eye=(0, 0, 3), vfov=20, width=16, height=16)
    for integrator in (sr.PathTracer(max_depth=1), sr.Whitted()):
        seen, bare = (np.asarray(sr.render(sr.Scene(*things, camera=camera), integrator, samples=1))
                      for things in ((ball, wall), (wall,)))  # fmt: skip
        np.testing.assert_allclose(seen, bare, rtol=1e-6)


KINDS = ("cutout", "bumpy", "oriented", "clear", "thin", "translucent")


@pytest.mark.parametrize(("material", "kinds"), [
    (sr.Lambert(), ()),
    (sr.Conductor(roughness=0.5, anisotropy=0.5), ("oriented",)),
    (sr.RoughGlass(), ("translucent",)),
    (sr.ThinGlass(), ("thin",)),
    (sr.Principled(transmission=sr.Checker(), thin_walled=True), ("thin", "translucent")),
    (sr.Boundary(interior=FOG), ("clear",)),
    (sr.Subsurface(preset="marble"), ("translucent",)),
    (sr.Cutout(material=sr.NormalMap(material=sr.Conductor(roughness=0.5, anisotropy=0.5), map=0.5), opacity=0.5),
     ("cutout", "bumpy", "oriented")),
    (sr.BumpMap(material=sr.Cutout(material=sr.RoughGlass(), opacity=0.5), height=0), ("cutout", "bumpy", "translucent")),
    (sr.Mix(a=sr.Boundary(interior=FOG), b=sr.ThinGlass()), ("thin",)),
    (sr.TwoSided(material=sr.Lambert(), back=sr.Conductor(anisotropy=1)), ("oriented",)),
])  # fmt: skip
def test_wrappers_are_what_they_wrap(material, kinds):
    assert tuple(kind for kind in KINDS if getattr(material, kind)) == kinds


@pytest.mark.parametrize("wrap", [
    lambda m: sr.Cutout(material=m, opacity=1), lambda m: sr.NormalMap(material=m, map=(0.5, 0.5, 1)),
    lambda m: sr.BumpMap(material=m, height=1), lambda m: sr.TwoSided(material=m),
    lambda m: sr.Mix(a=sr.Lambert(), b=m, amount=1), lambda m: sr.Mix(a=m, b=sr.Glass(), amount=0),
])  # fmt: skip
def test_wrappers_keep_emission_and_inside(wrap):
    inner = sr.Principled(transmission=1, emission=(1, 2, 3), interior=FOG)
    _, _, inside, emission = rest_of(wrap(inner))
    assert inside
    assert emission.tolist() == [1, 2, 3]
    assert wrap(sr.Emitter(radiance=6)).glow == 6


def test_what_is_inside():
    assert not rest_of(sr.Glass())[2]
    assert rest_of(sr.Glass(absorption=1))[2]
    assert rest_of(sr.RoughGlass(interior=FOG))[2]
    assert not rest_of(sr.Principled(absorption=1))[2]  # opaque
    assert not rest_of(sr.Principled(absorption=1, transmission=1, thin_walled=True))[2]  # a sheet
    assert rest_of(sr.Subsurface(preset="skin1"))[2]


def test_subsurface_presets_are_per_millimetre_and_reduced():
    marble = sr.Subsurface(preset="marble").medium()
    assert marble.scattering == pytest.approx((2190, 2620, 3000))
    assert marble.absorption == pytest.approx((2.1, 4.1, 7.1))
    forward = sr.Subsurface(preset="marble", g=0.8, scale=0.01).medium()
    assert forward.g == 0.8
    assert np.array(forward.scattering) * 0.2 == pytest.approx((21.9, 26.2, 30))
    assert forward.absorption == pytest.approx((0.021, 0.041, 0.071))
    assert {name: sr.Subsurface(preset=name).index for name in PRESETS} == {
        name: 1.5 if name == "marble" else 1.3 for name in PRESETS
    }


def test_total_diffuse_reflectance_of_marble():
    """ORACLES: the dipole's for marble."""
    assert sr.Subsurface(preset="marble").diffuse_reflectance() == pytest.approx((0.8302, 0.7910, 0.7526), abs=5e-5)


@pytest.mark.parametrize(("make", "message"), [
    (lambda: sr.Conductor(metal="silvr"), r"Conductor\.metal: unknown metal 'silvr'; did you mean 'silver'\?"),
    (lambda: sr.Conductor(eta=1), r"Conductor\.k: missing; eta and k are stated together"),
    (lambda: sr.Conductor(metal="Au", eta=1, k=1), r"Conductor\.metal: stated beside eta and k"),
    (lambda: sr.Conductor(eta=-1, k=1), r"Conductor\.eta: got -1; allowed: three finite numbers of at least 0"),
    (lambda: sr.Conductor(roughness=1.5), r"Conductor\.roughness: got 1\.5; .*at most 1"),
    (lambda: sr.Conductor(distribution="ggxx"), r"Conductor\.distribution: .*did you mean 'ggx'"),
    (lambda: sr.Glass(ior="N-BK8"), r"Glass\.ior: unknown refractive index 'N-BK8'; did you mean 'N-BK7'\?"),
    (lambda: sr.Glass(ior="Au"), r"Glass\.ior: .*'Au' is a metal"),
    (lambda: sr.Glass(absorption=1, interior=FOG), r"Glass\.absorption: stated beside interior"),
    (lambda: sr.Glass(interior=sr.Lambert()), r"Glass\.interior: got Lambert\(\); allowed: one of the media or None"),
    (lambda: sr.ThinGlass(ior=0.5), r"ThinGlass\.ior: got 0\.5; allowed: a finite number >= 1"),
    (lambda: sr.OrenNayar(sigma=91), r"OrenNayar\.sigma: got 91; allowed: .*<= 90 \(degrees\)"),
    (lambda: sr.Mix(a=sr.Lambert()), r"Mix\.b: missing; it needs one of the materials"),
    (lambda: sr.Cutout(material=sr.Lambert(), opacity=2), r"Cutout\.opacity: got 2; .*at most 1"),
    (lambda: sr.Boundary(), r"Boundary\.interior: missing; it needs one of the media"),
    (lambda: sr.Subsurface(), r"Subsurface\.preset: missing; it needs one of marble, .*scattering and absorption"),
    (lambda: sr.Subsurface(preset="marbel"), r"Subsurface\.preset: unknown preset 'marbel'; did you mean 'marble'\?"),
    (lambda: sr.Principled(metalic=1), r"Principled: unknown field 'metalic'; did you mean 'metallic'\?"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()


def test_maps_are_read_without_the_curve_of_pictures(tmp_path):
    picture = tmp_path / "map.png"
    sr.Image(np.full((2, 2, 3), 0.5)).save(picture)
    bitmap = sr.Bitmap(image=picture)
    assert sr.NormalMap(material=sr.Lambert(), map=bitmap).map.linear
    assert sr.Conductor(roughness=bitmap).roughness.linear
    assert not sr.Principled(base_color=bitmap).base_color.linear


def test_tables_of_energy_are_computed_once_for_all_processes(tmp_path, monkeypatch):
    """And again where the file is damaged; equal to the bit."""
    monkeypatch.setenv("SIGHTRAY_CACHE_DIR", str(tmp_path))
    calls = []

    def doubled(x: float) -> np.ndarray:
        calls.append(x)
        return np.array([2.0 * x, 0.1])

    for once in (1, 2):  # two processes
        table = stored(doubled)
        for _ in range(2):
            np.testing.assert_array_equal(table(3.5), [7.0, 0.1])
        assert calls == [3.5], once
    (file,) = tmp_path.glob("*.npy")
    file.write_bytes(file.read_bytes()[:-3])
    np.testing.assert_array_equal(stored(doubled)(3.5), [7.0, 0.1])
    assert len(calls) == 2
    np.testing.assert_array_equal(stored(doubled)(4.5), [9.0, 0.1])
    assert len(list(tmp_path.iterdir())) == 2
    monkeypatch.setenv("SIGHTRAY_CACHE_DIR", "")
    np.testing.assert_array_equal(stored(doubled)(3.5), [7.0, 0.1])


TURNED = sr.Transform.translate(0.2, 0.1, 0) @ sr.Transform.rotate((1, 2, 0.5), 40)
SOLID = {
    "sphere": (sr.Sphere(radius=0.8), sr.Transform()),
    "turned box": (sr.Box(), TURNED),
    "mirrored and stretched box": (sr.Box(), TURNED @ sr.Transform.scale(-1.2, 0.7, 0.9)),
    "cylinder": (sr.Cylinder(), TURNED),
}


@pytest.mark.parametrize("name", SOLID)
def test_solid_relief_follows_the_surface(name):
    """Heights that grow along an axis of the shape's space tilt normals by their slope within the surface."""
    shape, place = SOLID[name]
    height = sr.Gradient(colors=[[0] * 3, [1] * 3], along="z", begin=-5, end=5)
    bump = sr.BumpMap(material=sr.Lambert(), height=height, scale=3)
    scene = sr.Scene(sr.Instance(of=shape.replace(material=bump), transform=place),
                     camera=sr.PerspectiveCamera(eye=(1.5, 1, 4), vfov=40, width=24, height=18))  # fmt: skip
    labels = sr.label(scene, "normal", "shading_normal")
    slope = 0.3 * np.linalg.inv(place.matrix[:3, :3]).T @ (0, 0, 1)
    n = np.asarray(labels.normal, float)
    hit = np.isfinite(n[..., 0])
    assert hit.sum() > 40
    n = n[hit]
    expected = n - (slope - n * (n @ slope)[:, None])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.abs(expected - n).max() > 0.05
    np.testing.assert_allclose(np.asarray(labels.shading_normal, float)[hit], expected, atol=1e-5)
