"""Marble, milk, skin: light enters, wanders about below the surface, and comes out somewhere near."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements
from sightray.errors import SceneError, unknown
from sightray.fields import derived_child, derived_number, derived_vector, number, other
from sightray.materials.base import BsdfSample, BsdfValue, Local, Material, bsdf, interior, local, sample_bsdf
from sightray.materials.gloss import glossy, softened
from sightray.materials.rough_glass import RoughGlass
from sightray.mathlib.frame import fresnel
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, grey
from sightray.media.homogeneous import HomogeneousMedium
from sightray.textures.base import Where

PER_MM = 1000.0  # 1/m
PRESETS = {  # reduced scattering and absorption of red, green and blue, 1/mm; refractive index
    "marble": ((2.19, 2.62, 3.00), (0.0021, 0.0041, 0.0071), 1.5),
    "skim milk": ((0.70, 1.22, 1.90), (0.0014, 0.0025, 0.0142), 1.3),
    "whole milk": ((2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014), 1.3),
    "skin1": ((0.74, 0.88, 1.01), (0.032, 0.17, 0.48), 1.3),
    "skin2": ((1.09, 1.59, 1.79), (0.013, 0.070, 0.145), 1.3),
    "ketchup": ((0.18, 0.07, 0.03), (0.061, 0.97, 1.45), 1.3),
}


def _preset(value: Any) -> str | None:
    if value is not None and value not in PRESETS:
        raise SceneError(unknown("preset", str(value), PRESETS))
    return value


def _coefficient(value: Any) -> tuple[float, float, float] | None:
    """Three numbers of at least 0, or one for all three, or None."""
    if value is None:
        return None
    try:
        numbers = np.broadcast_to(np.asarray(value, dtype=np.float64), 3)
    except (TypeError, ValueError):
        numbers = np.full(3, -1.0)
    if not np.isfinite(numbers).all() or (numbers < 0).any():
        raise SceneError(
            f"got {value!r:.60}; allowed: three finite numbers of at least 0, or one for all (1/m), or None"
        )
    r, g, b = numbers.tolist()
    return r, g, b


class Subsurface(Material):
    """A dielectric boundary, smooth or rough, with a medium inside that scatters: walked through, not approximated.

    `preset` takes measured coefficients: ``"marble" "skim milk" "whole milk" "skin1" "skin2" "ketchup"`` (H. Jensen,
    S. Marschner, M. Levoy, P. Hanrahan, "A practical model for subsurface light transport", SIGGRAPH 2001). What was
    measured is the *reduced* scattering coefficient (1 - g) s, which many bounces depend on alone; so at another `g`
    than 0 the medium scatters by s = reduced / (1 - g), and looks nearly the same. `scattering` and `absorption`,
    which stand in place of the preset's, are those of the medium itself: nothing is reduced.

    Lengths are metres. An object that is modelled n times as large as it is wants ``scale=1/n``. Light takes hundreds
    of turns in marble or milk, so pictures take long. Shapes must be closed.

    Whitted's model shows a matte surface of the total diffuse reflectance of the same paper's dipole, and highlights.
    """

    preset: str | None = other("name of a measured material, or None", _preset, default=None)
    scattering: Any = other("scattering coefficient", _coefficient, default=None, unit="1/m",
                            plain=lambda v: v and list(v))  # fmt: skip
    absorption: Any = other("absorption coefficient", _coefficient, default=None, unit="1/m",
                            plain=lambda v: v and list(v))  # fmt: skip
    g: float = number("mean cosine of scattering: 0 even, towards 1 forward", default=0.0, above=-1, below=1)
    ior: float | None = number("refractive index; None for the preset's, or 1.3", default=None, at_least=1,
                               optional=True)  # fmt: skip
    roughness: float = number("perceived roughness of the surface, 0 to 1", default=0.0, at_least=0, at_most=1)
    scale: float = number("factor on both coefficients", default=1.0, above=0)
    _boundary: Any = derived_child("the surface, with the medium inside", lambda s: s.boundary())
    _albedo: Any = derived_vector("total diffuse reflectance", lambda s: s.diffuse_reflectance())
    _index: Any = derived_number("refractive index", lambda s: s.index)
    _alpha: Any = derived_number("roughness of the facets", lambda s: s.roughness**2)

    def check(self) -> None:
        """Refuse a medium that is stated by half."""
        if self.preset is None and (self.scattering is None or self.absorption is None):
            raise SceneError(f"Subsurface.preset: missing; it needs one of {', '.join(PRESETS)}, or both scattering and "
                             "absorption")  # fmt: skip

    @property
    def filled(self) -> bool:
        return True

    @property
    def translucent(self) -> bool:
        return True

    @property
    def index(self) -> float:
        """The refractive index that counts."""
        if self.ior is not None:
            return self.ior
        return 1.3 if self.preset is None else PRESETS[self.preset][2]

    def medium(self) -> HomogeneousMedium:
        """The medium inside."""
        scattering, absorption = self.scattering, self.absorption
        if self.preset is not None:
            reduced, absorbed, _ = PRESETS[self.preset]
            if scattering is None:
                scattering = [PER_MM * s / (1.0 - self.g) for s in reduced]
            if absorption is None:
                absorption = [PER_MM * s for s in absorbed]
        scaled = (tuple(self.scale * value for value in values) for values in (scattering, absorption))
        return HomogeneousMedium(**dict(zip(("scattering", "absorption"), scaled, strict=True)), g=self.g)

    def boundary(self) -> RoughGlass:
        """The surface, with the medium inside."""
        return RoughGlass(ior=self.index, roughness=self.roughness, interior=self.medium())

    def diffuse_reflectance(self) -> tuple[float, ...]:
        """(3,) the share of light that comes back from a deep slab, by the dipole of Jensen and others, equation 15."""
        medium = self.medium()
        eta = self.index
        inner = -1.440 / eta**2 + 0.710 / eta + 0.668 + 0.0636 * eta  # the paper's fit of the mean reflectance inside
        a = (1.0 + inner) / (1.0 - inner)
        result = []
        for scattering, absorption in zip(medium.scattering, medium.absorption, strict=True):
            reduced = (1.0 - self.g) * scattering
            albedo = reduced / (reduced + absorption) if reduced > 0 else 0.0
            root = math.sqrt(3.0 * (1.0 - albedo))
            result.append(0.5 * albedo * (1.0 + math.exp(-4.0 / 3.0 * a * root)) * math.exp(-root))
        return tuple(result)


BOUNDARY, ALBEDO, INDEX, ALPHA = Subsurface.offsets()[-4:]


@implements(local, Subsurface)
def local_of_subsurface(material: Table, where: Where, cos_view: f64) -> Local:
    zero = grey(0.0)
    alpha = f64_at(material, ALPHA)
    share = fresnel(softened(cos_view, alpha), 1.0 / f64_at(material, INDEX))
    albedo = vec3_at(material, ALBEDO)
    return glossy(albedo, zero, albedo * (1.0 - share), grey(share), zero, alpha, 1.0, zero)


@implements(sample_bsdf, Subsurface)
def sample_subsurface(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    return sample_bsdf(table_at(material, BOUNDARY), where, wo, u, v, choice)


@implements(bsdf, Subsurface)
def bsdf_of_subsurface(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    return bsdf(table_at(material, BOUNDARY), where, wo, wi)


@implements(interior, Subsurface)
def interior_of_subsurface(material: Table) -> Table:
    return interior(table_at(material, BOUNDARY))
