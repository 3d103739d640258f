"""Our scenes for Mitsuba 3, as far as both know the same things: so that a race is run on one course."""

from __future__ import annotations

from typing import Any

import numpy as np

from sightray.errors import UnsupportedError
from sightray.lights.base import Light
from sightray.scene.compile import flatten


def mitsuba_dict(scene: Any, mi: Any, max_depth: int) -> dict[str, Any]:
    """The dictionary that Mitsuba loads; raises `UnsupportedError` for what is not translated."""
    camera = scene.camera
    found: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": max_depth + 1},  # it counts segments, we count bounces
        "sensor": {
            "type": "perspective", "fov": camera.vfov, "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(list(camera.eye), list(camera.target), list(camera.up)),
            "film": {"type": "hdrfilm", "width": camera.width, "height": camera.height, "rfilter": {"type": "box"}},
        },
    }  # fmt: skip
    for index, item in enumerate(flatten(scene)):
        if not isinstance(scene.objects[item.object], Light):
            found[f"shape{index}"] = _shape(item, mi)
    for index, light in enumerate(scene.lights):
        found[f"light{index}"] = _light(light, mi)
    return found


def _rgb(value: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)}


def _texture(value: Any, mi: Any) -> dict[str, Any]:
    if isinstance(value, tuple):
        return _rgb(value)
    if type(value).__name__ != "Bitmap":
        raise UnsupportedError(f"{type(value).__name__} is not translated for Mitsuba; allowed: colours and Bitmap")
    return {"type": "bitmap", "bitmap": mi.Bitmap(np.array(value.pixels, order="C")), "raw": True}


def _bsdf(material: Any, mi: Any) -> dict[str, Any]:
    kind = type(material).__name__
    if kind == "Lambert":
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": _texture(material.albedo, mi)}}
    if kind == "Glass":
        return {"type": "dielectric", "int_ior": material.ior, "ext_ior": 1.0}
    if kind == "Mirror":
        mirror = {"type": "conductor", "material": "none", "specular_reflectance": _texture(material.reflectance, mi)}
        return {"type": "twosided", "bsdf": mirror}
    raise UnsupportedError(f"{kind} is not translated for Mitsuba; allowed: Lambert, Glass, Mirror")


def _place(matrix: np.ndarray, mi: Any) -> Any:
    return mi.ScalarTransform4f(matrix)


def _shape(item: Any, mi: Any) -> Any:
    shape, place, bsdf = item.shape, item.transform.matrix, _bsdf(item.material, mi)
    kind = type(shape).__name__
    if kind == "Mesh":
        return _mesh(shape, item.transform, bsdf, mi)
    inner = np.eye(4)
    if kind == "Sphere":
        inner[:3] = np.column_stack([np.eye(3) * shape.radius, shape.center])
    elif kind == "Box":
        lower, upper = np.asarray(shape.lower), np.asarray(shape.upper)
        inner[:3] = np.column_stack([np.diag((upper - lower) / 2), (upper + lower) / 2])
    else:
        raise UnsupportedError(f"{kind} is not translated for Mitsuba; allowed: Mesh, Sphere, Box")
    return {"type": {"Sphere": "sphere", "Box": "cube"}[kind], "to_world": _place(place @ inner, mi), "bsdf": bsdf}


def _mesh(shape: Any, place: Any, bsdf: dict[str, Any], mi: Any) -> Any:
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    mesh = mi.Mesh(shape.name or "mesh", len(shape.vertices), len(shape.faces), has_vertex_normals=shape.normals is not None,
                   has_vertex_texcoords=shape.uvs is not None, props=properties)  # fmt: skip
    values = mi.traverse(mesh)
    values["vertex_positions"] = np.float32(place.point(shape.vertices)).ravel()
    values["faces"] = np.uint32(shape.faces).ravel()
    if shape.normals is not None:
        normals = place.normal(shape.normals)
        values["vertex_normals"] = np.float32(normals / np.linalg.norm(normals, axis=1, keepdims=True)).ravel()
    if shape.uvs is not None:
        values["vertex_texcoords"] = np.float32(shape.uvs * (1, -1) + (0, 1)).ravel()  # its v runs downwards
    values.update()
    return mesh


def _light(light: Any, mi: Any) -> dict[str, Any]:
    kind = type(light).__name__
    if kind == "RectangleLight":
        u, v = np.asarray(light.edge_u) / 2, np.asarray(light.edge_v) / 2
        n = np.cross(u, v)
        place = np.eye(4)
        place[:3] = np.column_stack([u, v, n / np.linalg.norm(n), np.asarray(light.corner) + u + v])
        emitter = {"type": "area", "radiance": _rgb(light.radiance)}
        black = {"type": "diffuse", "reflectance": _rgb((0, 0, 0))}
        return {"type": "rectangle", "to_world": _place(place, mi), "emitter": emitter, "bsdf": black}
    if kind == "EnvironmentLight":
        pixels = np.array(light.pixels * np.float32(light.radiance), order="C")
        turn = np.diag([-1.0, 1.0, -1.0, 1.0])  # its first column looks where our middle one does
        return {"type": "envmap", "bitmap": mi.Bitmap(pixels), "to_world": _place(light.transform.matrix @ turn, mi)}
    raise UnsupportedError(f"{kind} is not translated for Mitsuba; allowed: RectangleLight, EnvironmentLight")
