"""Materials that the tests of the whole family ask: at least one of every member."""

from __future__ import annotations

import sightray as sr

FOG = sr.HomogeneousMedium(scattering=2, absorption=(0.1, 0.2, 0.3))

EXAMPLES = {
    "Lambert": [sr.Lambert(albedo=(0.9, 0.4, 0.1)), sr.Lambert(albedo=sr.Checker(scale=7), emission=3)],
    "OrenNayar": [sr.OrenNayar(albedo=(0.9, 0.4, 0.1)), sr.OrenNayar(albedo=1, sigma=60, emission=2)],
    "Phong": [
        sr.Phong(diffuse=0.5, specular=0.3, shininess=20),
        sr.Phong(diffuse=0, specular=1, shininess=3),
        sr.Phong(diffuse=0.2, specular=0.2, shininess=8, mirror=0.6, highlight="blinn"),
    ],
    "Mirror": [sr.Mirror(reflectance=0.8)],
    "Glass": [
        sr.Glass(ior=1.5),
        sr.Glass(ior=0.7),
        sr.Glass(ior=2.4175, absorption=(0, 1, 200), tint=(1, 0.5, 0)),
        sr.Glass(ior="N-BK7", interior=FOG),
        sr.Glass(ior=1),
    ],
    "ThinGlass": [sr.ThinGlass(), sr.ThinGlass(ior=2, tint=(1, 0.5, 0)), sr.ThinGlass(ior=1)],
    "RoughGlass": [
        sr.RoughGlass(roughness=0.7, tint=(1, 0.8, 0.3)),
        sr.RoughGlass(roughness=0.6, ior=0.7, distribution="beckmann"),
        sr.RoughGlass(roughness=0.15, ior=2.4),
        sr.RoughGlass(roughness=0),
        sr.RoughGlass(roughness=0.5, ior=1),
    ],
    "Conductor": [
        sr.Conductor(metal="Cu", roughness=0.6),
        sr.Conductor(metal="Ag", roughness=0.7, distribution="beckmann"),
        sr.Conductor(eta=(0.2, 0.9, 1.1), k=3, roughness=0.6, anisotropy=0.7),
        sr.Conductor(roughness=0.1),
        sr.Conductor(metal="Al"),
    ],
    "Principled": [
        sr.Principled(base_color=(0.8, 0.3, 0.1), roughness=0.6),
        sr.Principled(base_color=(0.8, 0.3, 0.1), metallic=1, roughness=0.5, emission=(1, 2, 3)),
        sr.Principled(transmission=1, roughness=0.9, ior=1.33, absorption=2),
        sr.Principled(transmission=0.7, metallic=0.2, roughness=0.6, thin_walled=True),
        sr.Principled(clearcoat=1, clearcoat_roughness=0.5, sheen=(0.9, 0.2, 0.4), sheen_roughness=0.4, roughness=0.8),
        sr.Principled(roughness=0.1, metallic=0.5, clearcoat=0.5),
        sr.Principled(base_color=(0.8, 0.3, 0.1), roughness=0.7, metallic=0.6, transmission=0.5, anisotropy=0.8,
                      anisotropy_rotation=35),
    ],
    "Mix": [
        sr.Mix(a=sr.Lambert(albedo=0), b=sr.Conductor(roughness=0.6), amount=0.3),
        sr.Mix(a=sr.RoughGlass(roughness=0.6), b=sr.Lambert(albedo=0.9)),
        sr.Mix(a=sr.Mirror(), b=sr.Lambert(emission=2), amount=0.75),
        sr.Mix(a=sr.Mix(a=sr.Emitter(), b=sr.Lambert()), b=sr.Phong(specular=0.4), amount=sr.Checker(even=0.2, odd=1)),
    ],
    "TwoSided": [
        sr.TwoSided(material=sr.Lambert(), back=sr.Conductor(roughness=0.6)),
        sr.TwoSided(material=sr.Phong(specular=0.4)),
    ],
    "Cutout": [sr.Cutout(material=sr.Lambert(albedo=0.8), opacity=0.5)],
    "NormalMap": [sr.NormalMap(material=sr.Conductor(roughness=0.5), map=(0.6, 0.5, 0.9))],
    "BumpMap": [sr.BumpMap(material=sr.Glass(), height=sr.Checker()), sr.BumpMap(material=sr.OrenNayar(), height=0.5)],
    "Boundary": [sr.Boundary(interior=FOG)],
    "Subsurface": [sr.Subsurface(preset="marble"), sr.Subsurface(scattering=5, absorption=(1, 2, 3), roughness=0.9)],
    "CourseGgx": [sr.CourseGgx(diffuse=0.3, specular=(0.5, 0.3, 0.1), roughness=0.4)],
    "Emitter": [sr.Emitter(), sr.Emitter(radiance=(1, 2, 3), two_sided=True)],
}  # fmt: skip


def index_behind(material):
    """The refractive index that light meets inside, over that outside."""
    match type(material).__name__:
        case "RoughGlass":
            return material.ior
        case "Subsurface":
            return material.index
        case "Principled":
            return 1.0 if material.thin_walled else material.ior
        case "Mix":
            return max(index_behind(material.a), index_behind(material.b))
    return 1.0
