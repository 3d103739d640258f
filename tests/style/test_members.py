"""What constructors promise: every field checked, one clear message, nothing changed afterwards."""

from __future__ import annotations

import numpy as np
import pytest

import sightray as sr
from sightray.errors import SceneError


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sr.Sphere(radius=-1), r"Sphere\.radius: got -1; allowed: a finite number > 0 \(m\)"),
        (lambda: sr.Sphere(radius=float("nan")), r"Sphere\.radius: got nan; allowed: a finite number"),
        (lambda: sr.Sphere(radius="1"), r"Sphere\.radius: got '1'; allowed: a finite number"),
        (lambda: sr.Sphere(radius=True), r"Sphere\.radius: got True; allowed"),
        (lambda: sr.Sphere(raduis=1), r"Sphere: unknown field 'raduis'; did you mean 'radius'\? Allowed: center, "),
        (lambda: sr.Sphere(center=(1, 2)), r"Sphere\.center: got \(1, 2\); allowed: three finite numbers \(m\)"),
        (lambda: sr.Sphere(center=(1, 2, np.inf)), r"Sphere\.center: got .* allowed: three finite numbers"),
        (lambda: sr.Sphere(material=sr.Sphere()), r"Sphere\.material: got Sphere\(\); allowed: one of the materials"),
        (lambda: sr.Sphere(transform=np.zeros((4, 4))), r"Sphere\.transform: .*last row"),
        (lambda: sr.Sphere(transform=np.diag([1, 1, 0, 1])), r"Sphere\.transform: singular transform"),
        (lambda: sr.PointLight(), r"PointLight\.position: missing; it needs three finite numbers"),
        (lambda: sr.PointLight(position=(0, 0, 0), attenuation=(0, 0, 0)), r"PointLight\.attenuation: .*not all zero"),
        (lambda: sr.Lambert(albedo=1.5), r"Lambert\.albedo: got 1\.5; allowed: a linear colour"),
        (lambda: sr.Lambert(albedo=(0, -0.1, 0)), r"Lambert\.albedo: got .* allowed: a linear colour"),
        (lambda: sr.Whitted(max_depth=2.5), r"Whitted\.max_depth: got 2\.5; allowed: a whole number"),
        (lambda: sr.Whitted(shadows=1), r"Whitted\.shadows: got 1; allowed: true or false"),
        (lambda: sr.PerspectiveCamera(vfov=180), r"PerspectiveCamera\.vfov: got 180; allowed: .* < 180"),
        (lambda: sr.PerspectiveCamera(width=0), r"PerspectiveCamera\.width: got 0; allowed: .*>= 1"),
        (lambda: sr.PerspectiveCamera(eye=(0, 0, 0)), "eye and target are the same point"),
        (lambda: sr.PerspectiveCamera(up=(0, 0, 1)), "parallel to the line of sight"),
        (lambda: sr.Scene(3), r"Scene\.objects: got 3; allowed: shapes, lights, groups and instances"),
        (lambda: sr.Scene(camera=sr.Sphere()), r"Scene\.camera: got Sphere\(\); allowed: one of the cameras"),
        (lambda: sr.Group(objects=[sr.PointLight(position=(0, 0, 0))]), "got a light; allowed: shapes"),
    ],
)
def test_bad_values_are_told_where_what_and_allowed(make, message):
    with pytest.raises(SceneError, match=message):
        make()


def test_members_are_immutable_and_replaceable():
    ball = sr.Sphere(radius=2, name="ball")
    with pytest.raises(AttributeError, match=r"immutable; use \.replace\(radius"):
        ball.radius = 3
    bigger = ball.replace(radius=3)
    assert (bigger.radius, bigger.name, ball.radius) == (3.0, "ball", 2.0)
    assert repr(bigger) == "Sphere(name='ball', radius=3.0)"


def test_deep_nesting_is_refused():
    thing = sr.Sphere()
    for _ in range(64):
        thing = sr.Group(objects=[thing])
    with pytest.raises(SceneError, match="nested deeper than 64"):
        sr.Group(objects=[thing])


def test_transform_composes_right_to_left():
    t = sr.Transform.translate(0, 1, 0) @ sr.Transform.rotate((0, 0, 1), 90) @ sr.Transform.scale(2)
    np.testing.assert_allclose(t.point([(1, 0, 0)]), [(0, 3, 0)], atol=1e-15)
    np.testing.assert_allclose(t.inverse @ t.matrix, np.eye(4), atol=1e-15)
