"""glTF: nodes, accessors and materials arrive as the specification says."""

import json
import math

import format_examples
import numpy as np
import pytest
import trimesh
from format_examples import assert_same, image_with_a_light_top_left, points, shapes

import sightray as sr
from sightray.errors import FormatError, UnsupportedError
from sightray.formats import load_scene
from sightray.materials.cutout import Cutout
from sightray.materials.microfacet import GGX, facets
from sightray.materials.normal_map import NormalMap
from sightray.materials.principled import Principled
from sightray.scene.instance import Instance

write = format_examples.write


def gltf(write, tree, arrays=(), name="a.gltf"):
    """Write a glTF whose accessors are the given arrays, each in a buffer view of its own."""
    kinds = {"f": 5126, "B": 5121, "H": 5123, "I": 5125}
    blob, views, accessors = b"", [], []
    for array in arrays:
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "count": len(array), "componentType": kinds[array.dtype.char],
                          "type": "SCALAR" if array.ndim == 1 else f"VEC{array.shape[1]}"})  # fmt: skip
        blob += array.tobytes() + b"\0" * (-array.nbytes % 4)
    write("a.bin", blob)
    base = {"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin", "byteLength": len(blob)}], "bufferViews": views}
    base["accessors"] = accessors
    for key, value in tree.items():
        base[key] = value(base) if callable(value) else value
    return write(name, json.dumps(base))


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)


def test_glb_keeps_textures_nodes_and_instances(tmp_path):
    from PIL import Image

    image_with_a_light_top_left(tmp_path / "p.png")
    quad = trimesh.Trimesh(SQUARE, [[0, 1, 3], [0, 3, 2]], process=False)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.open(tmp_path / "p.png"))
    quad.visual = trimesh.visual.TextureVisuals(uv=SQUARE[:, :2], material=material)
    scene = trimesh.Scene()
    scene.add_geometry(quad, geom_name="quad", node_name="left")
    scene.add_geometry(quad, geom_name="quad", node_name="right", parent_node_name="left",
                       transform=trimesh.transformations.translation_matrix([5, 0, 0]))  # fmt: skip
    scene.export(tmp_path / "a.glb")
    loaded = load_scene(tmp_path / "a.glb")
    meshes = {part.of if isinstance(part, Instance) else part for part in shapes(loaded)}
    for mesh in meshes:
        assert np.allclose(mesh.uvs, SQUARE[:, :2])  # v upwards again, as trimesh has it
        assert mesh.material.base_color.pixels[0, 0].tolist() == [1, 1, 1]
    assert sorted(part.transform.matrix[0, 3] for part in shapes(loaded)) == [0, 5]


def test_gltf_strips_fans_and_normalised_texture_coordinates(write):
    uv = np.array([[0, 0], [65535, 0], [0, 65535], [65535, 65535]], np.uint16)
    ring = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)

    def normalise(base):
        base["accessors"][1]["normalized"] = True
        return [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "mode": 5},
                                {"attributes": {"POSITION": 2}, "mode": 6},
                                {"attributes": {"POSITION": 2}, "mode": 0}]}]  # fmt: skip

    strip, fan = shapes(load_scene(gltf(write, {"meshes": normalise}, [SQUARE, uv, ring])))
    for mesh in (strip, fan):
        a, b, c = np.moveaxis(points(mesh), 1, 0)
        assert np.cross(b - a, c - a)[:, 2].tolist() == [1, 1]
    assert (strip.uvs == [[0, 1], [1, 1], [0, 0], [1, 0]]).all()


def test_gltf_sparse_accessors_and_nodes_by_matrix_and_by_parts(write):
    index, value = np.array([1], np.uint8), np.array([[3, 0, 0]], np.float32)

    def sparse(base):
        base["accessors"][0]["sparse"] = {"count": 1, "indices": {"bufferView": 1, "componentType": 5121},
                                          "values": {"bufferView": 2}}  # fmt: skip
        return [{"primitives": [{"attributes": {"POSITION": 0}}]}]

    turn = math.sqrt(0.5)
    nodes = [{"children": [1], "translation": [0, 0, 1]},
             {"mesh": 0, "rotation": [0, 0, turn, turn], "scale": [2, 1, 1], "name": "leaf", "children": [2]},
             {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1]}]  # fmt: skip
    tree = {"meshes": sparse, "nodes": nodes, "scenes": [{"nodes": [0]}]}
    leaf, child = shapes(load_scene(gltf(write, tree, [SQUARE[:3], index, value])))
    assert leaf.of is child.of
    assert leaf.name == "leaf"
    assert leaf.of.vertices.tolist() == [[0, 0, 0], [3, 0, 0], [0, 1, 0]]
    assert np.allclose(leaf.transform.point([3, 0, 0]), [0, 6, 1])
    assert np.allclose(child.transform.point([0, 0, 0]), [0, 14, 1])
    nodes[2]["children"] = [1]
    with pytest.raises(FormatError, match="node 1 stands in two places"):
        load_scene(gltf(write, tree, [SQUARE[:3], index, value]))


def materials_of(write, *materials, **tree):
    """The materials of a file with one triangle of each."""
    meshes = [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": i}
                              for i in range(len(materials))]}]  # fmt: skip
    path = gltf(write, {"materials": list(materials), "meshes": meshes, **tree}, [SQUARE[:3], SQUARE[:3, :2].copy()])
    return [mesh.material for mesh in shapes(load_scene(path))]


def extensions(**named):
    return {"extensions": {f"KHR_materials_{name}": value for name, value in named.items()}}


def test_gltf_materials(write):
    matte, bare, glass, pane, cloth = materials_of(
        write,
        {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1], "metallicFactor": 0},
         "emissiveFactor": [1, 0, 0], **extensions(emissive_strength={"emissiveStrength": 5}, ior={"ior": 1.4})},
        {},
        {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.1}, **extensions(
            transmission={"transmissionFactor": 1},
            volume={"thicknessFactor": 1, "attenuationDistance": 0.5, "attenuationColor": [1, math.exp(-1), 1]})},
        extensions(transmission={"transmissionFactor": 0.5}),
        extensions(sheen={"sheenColorFactor": [1, 0, 0], "sheenRoughnessFactor": 0.7}, specular={"specularFactor": 0.5},
                   clearcoat={"clearcoatFactor": 0.8, "clearcoatRoughnessFactor": 0.2}),
    )  # fmt: skip
    common = {"thin_walled": True, "roughness": 1, "metallic": 1, "base_color": 1}
    assert_same(matte, Principled(**{**common, "base_color": (0.5, 0.25, 1), "metallic": 0}, ior=1.4, emission=(5, 0, 0)))
    assert_same(bare, Principled(**common))  # what is not stated is rough white metal, says the specification
    assert (glass.transmission, glass.thin_walled) == ((1,) * 3, False)
    assert (glass.metallic, glass.roughness) == ((0,) * 3, (0.1,) * 3)
    assert glass.absorption == pytest.approx((0, 2, 0))
    assert (pane.transmission, pane.thin_walled) == ((0.5,) * 3, True)
    assert (cloth.sheen, cloth.sheen_roughness, cloth.specular) == ((1, 0, 0), (0.7,) * 3, (0.5,) * 3)
    assert (cloth.clearcoat, cloth.clearcoat_roughness) == ((0.8,) * 3, (0.2,) * 3)


@pytest.mark.parametrize(("roughness", "strength"), [(0.5, 0.6), (0.9, 0.3), (0.3, 0.2)])
def test_gltf_anisotropy_has_the_alphas_that_the_extension_states(write, roughness, strength):
    (brushed,) = materials_of(write, {"pbrMetallicRoughness": {"roughnessFactor": roughness}, **extensions(
        anisotropy={"anisotropyStrength": strength, "anisotropyRotation": math.pi / 3})})  # fmt: skip
    shape = facets(GGX, brushed.roughness[0], brushed.anisotropy)
    assert shape.y == pytest.approx(roughness**2, rel=1e-6)
    assert shape.x == pytest.approx(roughness**2 + (1 - roughness**2) * strength**2, rel=1e-6)
    assert brushed.anisotropy_rotation == pytest.approx(60)


def test_gltf_dispersion(write):
    (prism,) = materials_of(write, extensions(
        transmission={"transmissionFactor": 1}, volume={"thicknessFactor": 1}, dispersion={"dispersion": 0.36}))  # fmt: skip
    f, d, c = np.interp((486.13, 587.56, 656.27), sr.spectra.WAVELENGTHS, prism.indices())
    assert d == pytest.approx(1.5, abs=1e-6)
    assert (d - 1) / (f - c) == pytest.approx(20 / 0.36, rel=1e-3)


def test_gltf_textures_go_where_they_belong(write, tmp_path):
    from PIL import Image

    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[0, 0] = 51, 102, 204, 128  # top left
    Image.fromarray(pixels).save(tmp_path / "p.png")
    of = {"index": 0}
    pbr = {"baseColorTexture": of, "metallicRoughnessTexture": of, "metallicFactor": 0.5, "roughnessFactor": 1}
    textures = {"images": [{"uri": "p.png"}], "textures": [{"source": 0, "sampler": 0}],
                "samplers": [{"magFilter": 9728, "wrapS": 33071}]}  # fmt: skip
    plain, masked, blended, bumpy = materials_of(
        write, {"pbrMetallicRoughness": pbr}, {"pbrMetallicRoughness": pbr, "alphaMode": "MASK", "alphaCutoff": 0.3},
        {"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.25]}, "alphaMode": "BLEND"},
        {"normalTexture": {**of, "scale": 0.5}, "emissiveTexture": of, "emissiveFactor": [1, 2, 4]}, **textures,
    )  # fmt: skip

    def top_left(texture):
        return texture.pixels[0, 0].tolist()

    assert isinstance(plain, Principled)
    assert top_left(plain.base_color) == pytest.approx([0.0331, 0.1329, 0.6038], abs=1e-4)  # colours are sRGB,
    assert top_left(plain.roughness)[0] == pytest.approx(0.4)  # numbers are not
    assert top_left(plain.metallic)[0] == pytest.approx(0.4)
    assert (plain.base_color.filter, plain.base_color.wrap) == ("nearest", "clamp")
    assert isinstance(masked, Cutout)
    assert masked.threshold == 0.3
    assert top_left(masked.opacity)[0] == pytest.approx(128 / 255)
    assert (blended.opacity, blended.threshold) == ((0.25,) * 3, None)
    assert isinstance(bumpy, NormalMap)
    assert bumpy.strength == 0.5
    assert top_left(bumpy.map) == pytest.approx([0.2, 0.4, 0.8])
    assert bumpy.material.emission.b == (1, 2, 4)


def test_gltf_claims_are_checked_before_memory_is_taken(write):
    mesh = [{"primitives": [{"attributes": {"POSITION": 0}}]}]
    for change in ({"count": 10**15}, {"count": -1}, {"count": 4}, {"componentType": 1}, {"type": "MAT9"},
                   {"bufferView": 7}):  # fmt: skip
        def accessors(base, change=change):
            return [{**base["accessors"][0], **change}]

        with pytest.raises(FormatError):
            load_scene(gltf(write, {"accessors": accessors, "meshes": mesh}, [SQUARE[:3]]))
    with pytest.raises(FormatError, match=r"file name '/etc/passwd\.bin'"):
        load_scene(gltf(write, {"buffers": [{"uri": "/etc/passwd.bin"}], "meshes": mesh}, [SQUARE[:3]]))
    with pytest.raises(UnsupportedError, match="KHR_draco"):
        load_scene(gltf(write, {"extensionsRequired": ["KHR_draco_mesh_compression"]}))
