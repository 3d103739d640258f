"""Materials of glTF files, as `Principled` and what goes around it.

Read are pbrMetallicRoughness, normal and emissive textures, alphaMode, and KHR_materials_ior, _specular, _clearcoat,
_sheen, _transmission, _volume, _anisotropy, _dispersion and _emissive_strength. Occlusion is ignored: light finds out by
itself what is hidden. Anisotropy is the same all over a surface: its texture is ignored, and where the roughness is a
picture, its mean decides how uneven it becomes. All textures of a material are laid out as its first one is; those that
use other texture coordinates are ignored.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from sightray.errors import FormatError, UnsupportedError
from sightray.formats.base import TEXTURES
from sightray.formats.gltf_buffers import Buffers
from sightray.images import load_image
from sightray.materials.cutout import Cutout
from sightray.materials.energy import SMOOTH
from sightray.materials.microfacet import MOST_UNEVEN
from sightray.materials.normal_map import NormalMap
from sightray.materials.principled import Principled
from sightray.textures.bitmap import Bitmap
from sightray.textures.multiply import Multiply

WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
NEAREST = 9728
RED, GREEN, BLUE, ALPHA = range(4)
NUMBER = (int, float)
DARKEST = 1e-6  # an attenuation colour of 0 would absorb without end


class Materials:
    """The materials of one file, each made once."""

    def __init__(self, file: Buffers):
        self.file, self.path = file, file.path
        self.images: dict[tuple[int, bool], Any] = {}
        self.made: dict[int, tuple[Any, dict[str, Any]]] = {}

    def material(self, index: Any) -> tuple[Any, dict[str, Any]]:
        """The material, and the entry of the texture that says where texture coordinates come from."""
        owner = self.file.item("materials", index)
        if index not in self.made:
            self.made[index] = self.make(owner)
        return self.made[index]

    def make(self, owner: Any) -> tuple[Any, dict[str, Any]]:
        """The material of one entry."""
        pbr = self.group(owner, "pbrMetallicRoughness")
        infos = [self.group(pbr, "baseColorTexture"), self.group(pbr, "metallicRoughnessTexture"),
                 self.group(owner, "normalTexture"), self.group(owner, "emissiveTexture")]  # fmt: skip
        layout = next((info for info in infos if info), {})
        uneven, rotation, wider = self.anisotropy(owner, infos[1])
        base, rough, normal, emissive = (info if self.fits(info, layout) else {} for info in infos)
        factor = self.floats(pbr, "baseColorFactor", 4, (1, 1, 1, 1))
        strength = self.number(self.extension(owner, "emissive_strength"), "emissiveStrength", 1.0)
        material: Any = Principled(
            base_color=self.colour(base, np.clip(factor[:3], 0, 1)),
            metallic=self.channel(rough, BLUE, self.share(pbr, "metallicFactor", 1.0)),
            roughness=self.channel(rough, GREEN, self.share(pbr, "roughnessFactor", 1.0) * wider),
            anisotropy=uneven, anisotropy_rotation=rotation,
            emission=self.colour(emissive, np.maximum(self.floats(owner, "emissiveFactor", 3, (0, 0, 0)), 0)
                                 * max(0.0, strength)),
            **self.extensions(owner, layout),
        )  # fmt: skip
        if normal:
            scale = max(0.0, self.number(normal, "scale", 1.0))
            material = NormalMap(material=material, map=self.bitmap(normal, linear=True), strength=scale)
        return self.with_holes(material, owner, base, float(np.clip(factor[3], 0, 1))), layout

    def anisotropy(self, owner: Any, rough: Any) -> tuple[float, float, float]:
        """Principled's anisotropy and its rotation, and a factor on roughness.

        The alphas of GGX are ``mix(a, 1, strength²)`` along the direction and a across it, with a = roughness². Those of
        `Principled` are a' / aspect and a' aspect, with aspect² = 1 - 0.9 anisotropy; so a' is their geometric mean.
        """
        stated = self.extension(owner, "anisotropy")
        strength = self.share(stated, "anisotropyStrength", 0.0)
        if not strength > 0.0:
            return 0.0, 0.0, 1.0
        mean = self.share(self.group(owner, "pbrMetallicRoughness"), "roughnessFactor", 1.0)
        if rough:
            pixels = self.pixels(rough, linear=True)
            mean *= float(pixels[..., min(GREEN, pixels.shape[2] - 1)].mean())
        across = max(SMOOTH, mean**2)
        along = across + (1.0 - across) * strength**2
        uneven = min(1.0, (1.0 - across / along) / MOST_UNEVEN)
        turn = math.degrees(self.number(stated, "anisotropyRotation", 0.0))
        return uneven, turn, (along / across) ** 0.25

    def extensions(self, owner: Any, layout: Any) -> dict[str, Any]:
        """Fields that extensions state."""
        fields: dict[str, Any] = {}
        ior = self.number(self.extension(owner, "ior"), "ior", 1.5)
        fields["ior"] = ior if ior >= 1 else 1.5
        fields["dispersion"] = max(0.0, self.number(self.extension(owner, "dispersion"), "dispersion", 0.0))
        fields["specular"] = self.share(self.extension(owner, "specular"), "specularFactor", 1.0)
        for name, keys in (
            ("clearcoat", {"clearcoat": ("clearcoat", RED), "clearcoat_roughness": ("clearcoatRoughness", GREEN)}),
            ("sheen", {"sheen_roughness": ("sheenRoughness", ALPHA)}),
            ("transmission", {"transmission": ("transmission", RED)}),
        ):
            stated = self.extension(owner, name)
            for field, (key, channel) in keys.items() if stated else ():
                info = self.group(stated, f"{key}Texture")
                fields[field] = self.channel(info if self.fits(info, layout) else {}, channel,
                                             self.share(stated, f"{key}Factor", 0.0))  # fmt: skip
        if sheen := self.extension(owner, "sheen"):
            info = self.group(sheen, "sheenColorTexture")
            colour = np.clip(self.floats(sheen, "sheenColorFactor", 3, (0, 0, 0)), 0, 1)
            fields["sheen"] = self.colour(info if self.fits(info, layout) else {}, colour)
        volume = self.extension(owner, "volume")
        fields["thin_walled"] = not self.number(volume, "thicknessFactor", 0.0) > 0
        distance = self.number(volume, "attenuationDistance", math.inf)
        if not fields["thin_walled"] and 0 < distance < math.inf:
            left = np.clip(self.floats(volume, "attenuationColor", 3, (1, 1, 1)), DARKEST, 1)
            fields["absorption"] = tuple(-np.log(left) / distance)
        return fields

    def with_holes(self, material: Any, owner: Any, base: Any, alpha: float) -> Any:
        """A material that is there as far as its alpha says."""
        mode = self.file.get(owner, "alphaMode", str, "OPAQUE")
        if mode not in ("MASK", "BLEND"):
            return material
        share = self.channel(base, ALPHA, alpha)
        threshold = float(np.clip(self.number(owner, "alphaCutoff", 0.5), 1e-6, 1)) if mode == "MASK" else None
        return material if share == 1 else Cutout(material=material, opacity=share, threshold=threshold)

    def group(self, owner: Any, key: str) -> dict[str, Any]:
        return self.file.get(owner, key, dict, {})

    def extension(self, owner: Any, name: str) -> dict[str, Any]:
        return self.group(self.group(owner, "extensions"), f"KHR_materials_{name}")

    def number(self, owner: Any, key: str, default: float) -> float:
        value = self.file.get(owner, key, NUMBER, default)
        if not (math.isfinite(value) or value == default):
            raise FormatError(f"'{key}': got {value}; expected a finite number", self.path)
        return float(value)

    def share(self, owner: Any, key: str, default: float) -> float:
        return min(1.0, max(0.0, self.number(owner, key, default)))

    def floats(self, owner: Any, key: str, count: int, default: Any) -> np.ndarray:
        return self.file.floats(owner, key, count, default)

    def fits(self, info: Any, layout: Any) -> bool:
        """Whether a texture lies as the first one does."""
        return bool(info) and info.get("texCoord", 0) == layout.get("texCoord", 0)

    def colour(self, info: Any, factor: np.ndarray) -> Any:
        """A colour, or a picture times a colour."""
        if not info:
            return tuple(factor)
        picture = self.bitmap(info, linear=False)
        return picture if (factor == 1).all() else Multiply(a=picture, b=tuple(factor))

    def channel(self, info: Any, channel: int, factor: float) -> Any:
        """A number, or one channel of a picture times a number."""
        if not info:
            return factor
        pixels = self.pixels(info, linear=True)
        if channel >= pixels.shape[2]:  # alpha of an opaque picture; grey pictures have one channel for all
            if channel == ALPHA:
                return factor
            channel = 0
        return self.bitmap(info, linear=True, pixels=pixels[..., channel] * np.float32(factor))

    def bitmap(self, info: Any, *, linear: bool, pixels: np.ndarray | None = None) -> Bitmap:
        """A picture as its sampler wants it."""
        owner = self.file.item("textures", info.get("index"))
        sampler = self.file.item("samplers", owner["sampler"]) if "sampler" in owner else {}
        picture = self.picture(owner, linear) if pixels is None else pixels
        return Bitmap(image=picture, wrap=WRAPS.get(sampler.get("wrapS", 10497), "repeat"),
                      linear=linear and isinstance(picture, Path),
                      filter="nearest" if sampler.get("magFilter") == NEAREST else "bilinear")  # fmt: skip

    def pixels(self, info: Any, *, linear: bool) -> np.ndarray:
        """(h, w, channels) float32 of a texture's picture."""
        picture = self.picture(self.file.item("textures", info.get("index")), linear)
        return load_image(picture, linear=linear).pixels if isinstance(picture, Path) else picture

    def picture(self, owner: Any, linear: bool) -> Any:
        """Path of a texture's picture, or the pixels of an embedded one."""
        if "source" not in owner:
            raise UnsupportedError(f"{self.path}: a texture of another kind than PNG or JPEG")
        index = owner["source"]
        entry = self.file.item("images", index)
        if (index, linear) not in self.images:
            found: Any = None
            if "bufferView" in entry:
                found = bytes(self.file.view(entry["bufferView"])[0])
            elif "uri" in entry:
                found = self.file.uri(self.file.get(entry, "uri", str), TEXTURES)
            if isinstance(found, bytes):
                # The codec goes by the first bytes, so ".png" does for JPEG too.
                with tempfile.TemporaryDirectory() as folder:
                    file = Path(folder) / "embedded.png"
                    file.write_bytes(found)
                    found = load_image(file, linear=linear).pixels
            if isinstance(found, Path) and not found.exists():
                raise FormatError(f"images: {found} is missing; expected a PNG or JPEG file there", self.path)
            self.images[index, linear] = found
        return self.images[index, linear]
