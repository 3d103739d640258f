"""Materials: what every one promises, and what each one says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from material_examples import EXAMPLES, FOG

import sightray as sr
from sightray._jit import kernel, native
from sightray.errors import SceneError
from sightray.materials.base import BLINN, PHONG, Local, local
from sightray.materials.emitter import Emitter
from sightray.materials.glass import Glass
from sightray.materials.lambert import Lambert
from sightray.materials.mirror import Mirror
from sightray.materials.phong import HIGHLIGHTS, Phong
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import Table, f64_at, f64_put, i64_put, vec3_at, vec3_put
from sightray.scene.compile import Tables
from sightray.textures.base import anywhere
from sightray.textures.checker import Checker

EVERY = [pytest.param(m, id=f"{name}-{i}") for name, all_of in EXAMPLES.items() for i, m in enumerate(all_of)]
IN, OUT = 8, 40  # words per question and answer
LANES = {"color": 0, "emission": 4, "ambient": 8, "diffuse": 12, "specular": 16, "mirror": 24, "transmission": 28}


@kernel
def ask(material: Table, count: i64, questions: Table, answers: Table) -> i64:
    """`local` for many places; a question is u, v, p, cos_view."""
    for i in range(count):
        q, a = IN * i, OUT * i
        where = anywhere(f64_at(questions, q), f64_at(questions, q + 1), vec3_at(questions, q + 2))
        x = local(material, where, f64_at(questions, q + 6))
        vec3_put(answers, a, x.color)
        vec3_put(answers, a + 4, x.emission)
        vec3_put(answers, a + 8, x.ambient)
        vec3_put(answers, a + 12, x.diffuse)
        vec3_put(answers, a + 16, x.specular)
        f64_put(answers, a + 20, x.shininess)
        i64_put(answers, a + 21, x.highlight)
        vec3_put(answers, a + 24, x.mirror)
        vec3_put(answers, a + 28, x.transmission)
        f64_put(answers, a + 32, x.eta)
        vec3_put(answers, a + 36, x.absorption)
    return count


def answers_of(material, questions: np.ndarray, compiled: bool = True) -> np.ndarray:
    """(n, 8) questions -> (n, 40) answers, by machine code or by Python."""
    tables = Tables()
    row = tables.row_of(material)
    tables.prepare(ask, compiled=compiled)
    out = np.zeros((len(questions), OUT))
    (native(ask) if compiled else ask)(row, len(questions), Table(questions), Table(out))
    return out


def one(material, cos_view: float = 1.0, u: float = 0.3, v: float = 0.3, p=(0.3, 0.3, 0.3)) -> dict:
    """One answer by name: colours as lists."""
    a = answers_of(material, np.array([[u, v, *p, 0, cos_view, 0]]))[0]
    named = {name: a[at : at + 3].tolist() for name, at in {**LANES, "absorption": 36}.items()}
    return {**named, "shininess": a[20], "highlight": int(a.view(np.int64)[21]), "eta": a[32]}


def random_questions(count: int = 64, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    questions = np.zeros((count, IN))
    questions[:, :5] = rng.uniform(-10, 10, (count, 5))
    questions[:, 6] = rng.uniform(-1, 1, count)
    questions[:4, 6] = 0.0, 1.0, -1.0, 1e-9
    return questions


@pytest.mark.parametrize("material", EVERY)
def test_machine_code_answers_as_python_does(material):
    questions = random_questions()
    expected = answers_of(material, questions, compiled=False)
    np.testing.assert_allclose(answers_of(material, questions), expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("material", EVERY)
def test_answers_are_finite_and_not_negative(material):
    answers = answers_of(material, random_questions())
    for name, at in LANES.items():
        assert np.isfinite(answers[:, at : at + 3]).all(), name
        assert (answers[:, at : at + 3] >= 0).all(), name
    assert (answers[:, 32] > 0).all()


UNBOUND = ("Phong", "CourseGgx", "Mix-3", "TwoSided-1")  # nothing keeps Phong's sums below 1


@pytest.mark.parametrize("material", [p for p in EVERY if not p.id.startswith(UNBOUND)])
def test_no_more_light_leaves_than_comes(material):
    a = answers_of(material, random_questions())
    leaves = math.pi * a[:, 12:15] + a[:, 24:27] + a[:, 28:31]
    assert leaves.max() <= 1 + 1e-12


@pytest.mark.parametrize("material", EVERY)
def test_repr_shows_what_was_asked_for(material):
    assert type(material).__name__ in repr(material)
    assert repr(material.replace()) == repr(material)


# --- each one ------------------------------------------------------------------------------------------------------


def test_the_indices_of_highlights_are_those_of_the_contract():
    assert (HIGHLIGHTS[PHONG], HIGHLIGHTS[BLINN]) == ("phong", "blinn")
    for name in HIGHLIGHTS:
        assert one(Phong(highlight=name))["highlight"] == HIGHLIGHTS.index(name)


def test_phong_puts_every_colour_in_its_place():
    colours = {"diffuse": (1, 2, 3), "specular": (4, 5, 6), "ambient": (7, 8, 9), "emission": (10, 11, 12)}
    material = Phong(**colours, mirror=(13, 14, 15), shininess=16)
    assert one(material) == one(material, cos_view=-1) == {
        "color": [1, 2, 3], "diffuse": [1, 2, 3], "specular": [4, 5, 6], "ambient": [7, 8, 9],
        "emission": [10, 11, 12], "mirror": [13, 14, 15], "transmission": [0, 0, 0], "absorption": [0, 0, 0],
        "shininess": 16, "highlight": PHONG, "eta": 1,
    }  # fmt: skip


def test_lambert_multiplies_irradiance_by_albedo_over_pi():
    answer = one(Lambert(albedo=(0.2, 0.4, 0.8), emission=(1, 2, 3)))
    np.testing.assert_allclose(answer["diffuse"], np.array([0.2, 0.4, 0.8]) / math.pi, rtol=1e-15)
    assert answer["ambient"] == answer["color"] == [0.2, 0.4, 0.8]
    assert answer["emission"] == [1, 2, 3]


def test_mirror_reflects_alike_from_every_angle():
    assert [one(Mirror(reflectance=(0.9, 0.5, 0)), c)["mirror"] for c in (1, 0.1, -1)] == [[0.9, 0.5, 0]] * 3


def test_textures_of_materials_follow_the_place():
    material = Mirror(reflectance=Checker(even=1, odd=0.25))
    assert one(material, u=0.5, v=0.5)["mirror"] == [1, 1, 1]
    assert one(material, u=1.5, v=0.5)["mirror"] == [0.25] * 3


def test_emitter_glows_on_its_outer_side():
    assert one(Emitter(radiance=(1, 2, 3)), 0.5)["emission"] == [1, 2, 3]
    assert one(Emitter(radiance=(1, 2, 3)), -0.5)["emission"] == [0, 0, 0]
    assert one(Emitter(radiance=(1, 2, 3), two_sided=True), -0.5)["emission"] == [1, 2, 3]


def test_glass_absorbs_inside_only():
    material = Glass(ior=1.5, absorption=(1, 2, 3))
    assert one(material, 0.7)["absorption"] == [0, 0, 0]
    assert one(material, -0.7)["absorption"] == [1, 2, 3]


def test_glass_sees_the_absorption_of_a_medium_inside():
    for material in (sr.Glass(interior=FOG), sr.RoughGlass(interior=FOG), sr.Boundary(interior=FOG),
                     sr.Principled(transmission=1, interior=FOG)):  # fmt: skip
        assert one(material, -0.7)["absorption"] == [0.1, 0.2, 0.3]
        assert one(material, 0.7)["absorption"] == [0, 0, 0]


def test_a_polished_metal_is_a_mirror_and_a_rough_one_shows_highlights():
    smooth, rough = one(sr.Conductor(metal="Ag")), one(sr.Conductor(metal="Ag", roughness=0.7))
    assert smooth["specular"] == smooth["diffuse"] == [0, 0, 0]
    assert min(smooth["mirror"]) > 0.9
    assert min(rough["specular"]) > 0.1
    assert max(rough["mirror"]) < 0.4
    assert rough["highlight"] == BLINN


def test_highlights_return_the_light_that_they_get():
    """A highlight of Blinn's exponent n, lit and seen head-on, returns (n + 8) / (8 pi) per irradiance of its share."""
    answer = one(sr.Conductor(eta=0, k=1, roughness=0.5))
    assert answer["shininess"] == pytest.approx(2 / 0.25**2 - 2)
    assert answer["specular"][0] == pytest.approx(0.75**2 * (answer["shininess"] + 8) / (8 * math.pi))
    assert answer["mirror"][0] + math.pi * answer["diffuse"][0] == pytest.approx(1)


def test_a_mix_is_its_parts_by_their_shares():
    mix = one(sr.Mix(a=Lambert(albedo=0.8, emission=4), b=Mirror(), amount=0.25))
    assert mix["diffuse"] == pytest.approx([0.6 / math.pi] * 3)
    assert mix["mirror"] == [0.25] * 3
    assert mix["emission"] == [3, 3, 3]


def test_two_sides():
    card = sr.TwoSided(material=Lambert(albedo=(1, 0, 0)), back=Emitter(radiance=7))
    assert one(card, 0.5)["color"] == [1, 0, 0]
    assert one(card, -0.5)["emission"] == [7, 7, 7]
    assert one(sr.TwoSided(material=Emitter(radiance=7)), -0.5)["emission"] == [7, 7, 7]


def test_local_has_no_field_that_these_tests_forget():
    assert set(Local._fields) == {*LANES, "shininess", "highlight", "eta", "absorption"}


@pytest.mark.parametrize(("make", "message"), [
    (lambda: Phong(shininess=-1), r"Phong\.shininess: got -1; allowed: a finite number >= 0"),
    (lambda: Phong(diffuse=-0.1), r"Phong\.diffuse: got .*-0\.1.*; allowed: a linear colour"),
    (lambda: Phong(highlight="blin"), r"Phong\.highlight: unknown choice 'blin'; did you mean 'blinn'\?"),
    (lambda: Phong(ambiant=1), r"Phong: unknown field 'ambiant'; did you mean 'ambient'\?"),
    (lambda: Phong(mirror=Mirror()), r"Phong\.mirror: got Mirror\(.*allowed: .*or a texture"),
    (lambda: Mirror(reflectance=1.1), r"Mirror\.reflectance: got .*1\.1.*; .*at most 1"),
    (lambda: Glass(ior=0), r"Glass\.ior: got 0; allowed: a finite number > 0"),
    (lambda: Glass(ior=math.nan), r"Glass\.ior: got nan"),
    (lambda: Glass(absorption=(0, -1, 0)), r"Glass\.absorption"),
    (lambda: Glass(tint=2), r"Glass\.tint: got .*2.*; .*at most 1"),
    (lambda: Emitter(two_sided=1), r"Emitter\.two_sided: got 1; allowed: true or false"),
])  # fmt: skip
def test_errors_say_where_what_and_what_is_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()
