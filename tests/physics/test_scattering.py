"""Light in scattering media against the theory of radiative transfer.

References
----------
S. Chandrasekhar, Radiative Transfer, 1950: chapter III (diffuse reflection of half-spaces, the H-functions), chapter VIII
(slabs). The integral equation of a slab's source function is solved here by cells, which shares nothing with the package.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import expn

import sightray as sr

FAR = 1e5  # metres, in units of mean free paths too: slabs without sides
RUNS = range(100, 124)  # seeds


def h_function(omega, mu, order=128):
    """Chandrasekhar's H(mu) for isotropic scattering with single-scattering albedo omega.

    1/H = sqrt(1 - omega) + omega/2 integral of m H(m) / (mu + m) from 0 to 1, iterated at Gauss-Legendre nodes.
    """
    x, w = np.polynomial.legendre.leggauss(order)
    x, w = (x + 1) / 2, w / 2
    h = np.ones(order)
    for _ in range(400):
        h = (h + 1 / (math.sqrt(1 - omega) + omega / 2 * ((w * x * h) / (x[:, None] + x)).sum(1))) / 2
    return 1 / (math.sqrt(1 - omega) + omega / 2 * (w * x * h / (mu + x)).sum())


def slab_radiance(omega, depth, mu0, mu, cells=800):
    """Radiance (reflected, transmitted diffusely) at the cosine mu, from a beam of irradiance 1 at the cosine mu0.

    S(t) = omega/(4 pi) exp(-t/mu0) + omega/2 integral of E1(|t - t'|) S(t') over the slab; each cell's S is constant.
    """
    edge = np.linspace(0, depth, cells + 1)
    t = (edge[1:] + edge[:-1]) / 2
    reach = expn(2, np.abs(t[:, None] - edge))
    inner = np.abs(reach[:, 1:] - reach[:, :-1])
    inner[np.arange(cells), np.arange(cells)] = 2 - reach[np.arange(cells), np.arange(cells)] * 2
    source = np.linalg.solve(np.eye(cells) - omega / 2 * inner, omega / (4 * math.pi) * np.exp(-t / mu0))
    up, down = np.exp(-edge / mu), np.exp(-(depth - edge) / mu)
    return (source * (up[:-1] - up[1:])).sum(), (source * (down[1:] - down[:-1])).sum()


def slab(omega, depth, **options):
    """A layer of medium of extinction 1 per metre under y = 0, `depth` metres deep."""
    medium = sr.HomogeneousMedium(scattering=omega, absorption=1 - omega, **options)
    box = sr.Box(lower=(-FAR, -depth, -FAR), upper=(FAR, 0, FAR), material=sr.Boundary(interior=medium))
    return box


def seen(mu, *objects, below=False, samples=64, **options):
    """Mean radiance towards an eye above (or below) the origin, at the cosine mu, and its standard error."""
    eye = np.array([math.sqrt(1 - mu * mu), mu, 0]) * 100
    eye[1] *= -1 if below else 1
    camera = sr.PerspectiveCamera(eye=eye, target=(0, 0, 0), up=(0, 0, 1), vfov=1e-3, width=8, height=8)
    scene = sr.Scene(*objects, camera=camera, **options)
    means = [np.asarray(sr.render(scene, sr.PathTracer(), samples=samples, seed=k)).mean() for k in RUNS]
    return np.mean(means), np.std(means, ddof=1) / math.sqrt(len(RUNS))


def sun(mu0):
    """A beam of irradiance 1 that comes in at the cosine mu0, from the side opposite to the viewer's."""
    return sr.DirectionalLight(direction=(0.6 * math.sqrt(1 - mu0**2), -mu0, 0.8 * math.sqrt(1 - mu0**2)), irradiance=1)


def test_h_functions_are_those_of_the_tables():
    """Chandrasekhar's table XI: H(1) = 2.9078 for conservative scattering; D. Stibbs, R. Weir, MNRAS 119, 1959."""
    assert h_function(1.0, 1.0) == pytest.approx(2.9078, abs=2e-4)
    assert h_function(1.0, 0.5) == pytest.approx(2.0128, abs=2e-4)
    x, w = np.polynomial.legendre.leggauss(64)
    mean = sum(wi / 2 * h_function(0.8, (xi + 1) / 2) for xi, wi in zip(x, w, strict=True))
    assert mean == pytest.approx(2 / 0.8 * (1 - math.sqrt(0.2)), rel=1e-6)  # section 38, theorem 1


@pytest.mark.parametrize(("omega", "mu0", "mu"), [(0.5, 0.6, 0.9), (0.9, 1.0, 0.5), (0.9, 0.3, 0.3), (0.99, 0.8, 0.4)])
def test_half_space_reflects_by_h_functions(omega, mu0, mu):
    """Under a beam of irradiance E across it: I = omega E / (4 pi) mu0 / (mu + mu0) H(mu) H(mu0)."""
    expected = omega / (4 * math.pi) * mu0 / (mu + mu0) * h_function(omega, mu) * h_function(omega, mu0)
    mean, error = seen(mu, slab(omega, FAR), sun(mu0))
    assert error < 0.01 * expected
    assert abs(mean - expected) < 4 * error + 1e-3 * expected


@pytest.mark.parametrize("omega", [0.3, 0.9, 0.99])
@pytest.mark.parametrize("mu", [1.0, 0.4])
def test_half_space_under_an_even_sky_shows_its_plane_albedo(omega, mu):
    """By reciprocity the radiance at mu is the albedo for light from there: 1 - H(mu) sqrt(1 - omega)."""
    expected = 1 - h_function(omega, mu) * math.sqrt(1 - omega)
    mean, error = seen(mu, slab(omega, FAR), background=1)
    assert error < 0.02 * expected
    assert abs(mean - expected) < 4 * error + 1e-3 * expected


@pytest.mark.parametrize(("omega", "depth"), [(0.9, 1.0), (1.0, 0.3), (0.8, 4.0)])
def test_slabs_reflect_and_transmit(omega, depth):
    reflected, transmitted = slab_radiance(omega, depth, 0.7, 0.5)
    for below, expected in ((False, reflected), (True, transmitted)):
        mean, error = seen(0.5, slab(omega, depth), sun(0.7), below=below)
        assert error < 0.02 * expected
        assert abs(mean - expected) < 4 * error + 2e-3 * expected


def test_a_thick_slab_is_a_half_space():
    """The two theories that the tests above rely on agree with one another."""
    expected = 0.9 / (4 * math.pi) * 0.7 / 1.2 * h_function(0.9, 0.5) * h_function(0.9, 0.7)
    assert slab_radiance(0.9, 25, 0.7, 0.5, cells=2000)[0] == pytest.approx(expected, rel=1e-3)


def test_absorption_alone_obeys_beer():
    medium = sr.HomogeneousMedium(absorption=(0.2, 0.7, 2))
    layer = sr.Box(lower=(-9, -1, -9), upper=(9, 0, 9), material=sr.Boundary(interior=medium))
    camera = sr.PerspectiveCamera(eye=(0.6, 0.8, 0), target=(0, 0, 0), up=(0, 0, 1), vfov=1e-3, width=1, height=1)
    image = np.asarray(sr.render(sr.Scene(layer, camera=camera, background=1), sr.PathTracer()))
    np.testing.assert_allclose(image[0, 0], np.exp(-np.array([0.2, 0.7, 2]) / 0.8), rtol=1e-6)


@pytest.mark.parametrize("eye", [(0, 0, 2.5), (0.2, 0.1, 0.3)])
@pytest.mark.parametrize("g", [0.0, 0.8])
@pytest.mark.parametrize("scattering", [2.0, (1, 2, 3)])
def test_furnace_in_a_medium_that_only_scatters(g, scattering, eye):
    """Radiance 1 from all around is radiance 1 everywhere within: a cloud in an even sky cannot be seen."""
    medium = sr.HomogeneousMedium(scattering=scattering, g=g)
    cloud = sr.Sphere(material=sr.Boundary(interior=medium))
    camera = sr.PerspectiveCamera(eye=eye, vfov=50, width=8, height=8)
    scene = sr.Scene(cloud, camera=camera, background=1)
    runs = np.array([np.asarray(sr.render(scene, sr.PathTracer(), samples=32, seed=k)).mean((0, 1)) for k in RUNS])
    error = runs.std(0, ddof=1) / math.sqrt(len(RUNS))
    assert (np.abs(runs.mean(0) - 1) < 4 * error + 1e-6).all()
    assert (error < 0.03).all()


def test_an_eye_within_a_cloud_sees_it():
    """A body of fog that fills a room is the same as a room full of fog, for an eye inside, too."""
    camera = sr.PerspectiveCamera(eye=(-0.5, 0.1, 0.3), target=(0.3, 0, 0), vfov=60, width=8, height=8)
    fog = sr.HomogeneousMedium(scattering=(1.5, 1.0, 0.5), absorption=0.5, g=0.4)
    room = sr.Sphere(material=sr.Lambert(albedo=0.6)), sr.PointLight(position=(0.4, 0, 0), intensity=1)
    body = sr.Sphere(radius=1 - 1e-6, material=sr.Boundary(interior=fog))

    def runs(scene):
        tracer = sr.PathTracer(max_depth=12)
        return np.array([np.asarray(sr.render(scene, tracer, samples=32, seed=k)).mean((0, 1)) for k in RUNS])

    a, b = runs(sr.Scene(*room, camera=camera, medium=fog)), runs(sr.Scene(*room, body, camera=camera))
    error = np.sqrt((a.var(0, ddof=1) + b.var(0, ddof=1)) / len(RUNS))
    assert (np.abs(a.mean(0) - b.mean(0)) < 4 * error).all()
    assert (error < 0.05 * a.mean(0)).all()


def test_furnace_full_of_fog():
    """Walls that glow, and fog in all of the room: light is looked for and met by chance, and is 1 from everywhere."""
    room = sr.Box(lower=(-1, -1, -1), upper=(1, 1, 1), material=sr.Lambert(albedo=0.5, emission=0.5))
    lamp = sr.Sphere(center=(0.5, 0, 0), radius=0.2, material=sr.Emitter(radiance=1))
    camera = sr.PerspectiveCamera(eye=(-0.5, 0.1, 0.3), target=(0.3, 0, 0), vfov=60, width=8, height=8)
    scene = sr.Scene(room, lamp, camera=camera, medium=sr.HomogeneousMedium(scattering=1.5, g=-0.3))
    means = [np.asarray(sr.render(scene, sr.PathTracer(max_depth=100), samples=32, seed=k)).mean() for k in RUNS]
    error = np.std(means, ddof=1) / math.sqrt(len(RUNS))
    assert abs(np.mean(means) - 1) < 4 * error
    assert error < 0.02


AROUND = sr.HomogeneousMedium(scattering=(0.5, 0.3, 0.2), absorption=(0.02, 0.05, 0.1), g=0.3)
CLEAR = sr.Boundary(interior=sr.HomogeneousMedium())
EYE, SEEN = (0, 0, 2.5), {"vfov": 50, "width": 12, "height": 9}
STILL = sr.PerspectiveCamera(eye=EYE, target=(0, 0, 0), **SEEN)
LENS = sr.ThinLensCamera(eye=EYE, target=(0, 0, 0), lens_radius=0.1, focus_distance=2, **SEEN)
BODIES = {
    "fog": (sr.Sphere(radius=1e3, material=sr.Boundary(interior=AROUND)), (), STILL),
    "glass that bends nothing": (sr.Sphere(radius=1e3, material=sr.Glass(ior=1.0, interior=AROUND)), (), STILL),
    "a mesh of few triangles": (
        sr.Mesh(
            vertices=[(x, y, z) for x in (-900, 900) for y in (-900, 900) for z in (-900, 900)],
            faces=[(0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5), (2, 3, 7), (2, 7, 6), (0, 2, 6),
                   (0, 6, 4), (1, 7, 3), (1, 5, 7)],
            material=sr.Boundary(interior=AROUND)),
        (), STILL),
    "a clear ball within fog": (
        sr.Sphere(radius=1e3, material=sr.Boundary(interior=AROUND)),
        (sr.Sphere(center=EYE, radius=0.2, material=CLEAR),), STILL),
    "a lens half in a clear ball": (
        sr.Sphere(radius=1e3, material=sr.Boundary(interior=AROUND)),
        (sr.Sphere(center=(0.2, 0, 2.5), radius=0.2, material=CLEAR),), LENS),
}  # fmt: skip


@pytest.mark.parametrize("name", BODIES)
def test_an_eye_within_a_body_sees_what_fills_it(name):
    """As if the scene were filled: nearly the same numbers are drawn, and light scatters in front of other things, too."""
    body, more, camera = BODIES[name]
    things = [sr.Sphere(radius=0.6, material=sr.Lambert(albedo=0.6)), *more,
              sr.SphereLight(center=(1.2, 1.0, 0.5), radius=0.2, radiance=40)]  # fmt: skip
    scenes = sr.Scene(*things, body, camera=camera), sr.Scene(*things, medium=AROUND, camera=camera)
    means = [np.mean([np.asarray(sr.render(scene, sr.PathTracer(max_depth=4), samples=64, seed=s)).mean(axis=(0, 1))
                      for s in range(4)], axis=0) for scene in scenes]  # fmt: skip
    np.testing.assert_allclose(means[0], means[1], rtol=0.03)
