"""One material with many parameters, as in glTF: plastic, metal, varnish, cloth, frosted glass."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sightray._jit import implements, kernel
from sightray.fields import (
    Color,
    child,
    color,
    derived_array,
    derived_child,
    derived_number,
    derived_vector,
    flag,
    number,
)
from sightray.materials.base import (
    BsdfSample,
    BsdfValue,
    Local,
    Material,
    Sample8,
    Value8,
    bsdf,
    bsdf_eight,
    emitted,
    interior,
    local,
    sample_bsdf,
    sample_eight,
)  # fmt: skip
from sightray.materials.body import check_body, medium_inside, stain
from sightray.materials.data import data, share8_of, share_of
from sightray.materials.dielectric import Boundary, boundary_of
from sightray.materials.eight_boundaries import Boundary8, back8
from sightray.materials.eight_facets import facets8
from sightray.materials.eight_layers import Layers8, layers_value8, sample_layers8, view8
from sightray.materials.eight_missing import tables8, tables8_or
from sightray.materials.energy import missing_of_glass, missing_of_mirrors, passing, reflected_by_glass
from sightray.materials.gloss import glossy, softened
from sightray.materials.index import disperses, index_at, indices_at
from sightray.materials.layers import COAT_INDEX, Layers, layers_value, sample_layers, schlick
from sightray.materials.microfacet import GGX, facets
from sightray.materials.sheen import sheen_table
from sightray.mathlib.bands import hero_only
from sightray.mathlib.eight_paths import grey8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    abs8d,
    gather8d,
    gather8i,
    not8,
    select8d,
    select8i,
    select8v,
    splat8d,
    vmax8d,
)
from sightray.mathlib.frame import fresnel
from sightray.mathlib.lanes import Mask8, movemask8
from sightray.mathlib.scalars import f64
from sightray.mathlib.table import Table, f64_at, i64_at, is_null, table_at, vec3_at
from sightray.mathlib.vec import Vec3, grey, max4
from sightray.spectra import WAVELENGTHS
from sightray.textures.base import Where, constant8, texture_value, textured, value_at
from sightray.textures.constant import COLOR

LEAST_INDEX = 1.0001  # where nothing bends light no facet says where it goes, and a lobe has no width
D_LINE, F_LINE, C_LINE = 587.56, 486.13, 656.27  # nm: between them Abbe's number measures dispersion


class Principled(Material):
    """Metallic-roughness shading as in glTF 2.0, with its extensions for coats, sheen and transmission.

    From below to the top:

    - a **base**: `metallic` of it is metal, GGX facets with Schlick's reflectance from `base_color` head-on to white;
      the rest is a dielectric of index `ior` that reflects colourlessly, `specular` times as much as Fresnel says, and
      below that `transmission` of it is clear, the others matte, both of `base_color`. All have the same `roughness`,
      and with `anisotropy` above 0 highlights that are long along u, below 0 across it, as on brushed metal;
      `anisotropy_rotation` turns that direction counter-clockwise.
    - a **sheen** of fibres of the colour `sheen` (`sheen.py`);
    - a **clear coat**, `clearcoat` times a varnish of index 1.5 with its own roughness.

    Each layer dims what is below it by what it reflects itself of viewer or light, whichever is more. Light that single
    reflections between facets lose comes back, so that a white base reflects all it gets (`energy.py`), and nothing ever
    reflects more. Facets have alpha = roughness², at least 0.001.

    What is clear bounds a closed body that bends light and is filled as in `Glass`; with `thin_walled` it is a sheet
    that light passes straight, blurred by the roughness. Sheen and coat lie on both sides; opaque parts look the same
    from both sides. Where `dispersion` is stated, 20 over the Abbe number, spectral paths are bent by wavelength, with
    Cauchy's n = a + b / wavelength² that is `ior` at the d line.

    References: Khronos Group, glTF 2.0, appendix B, and KHR_materials_{ior, specular, clearcoat, sheen, transmission,
    volume, anisotropy, dispersion}; B. Burley, "Physically based shading at Disney", SIGGRAPH 2012 course.
    """

    base_color: Any = textured("colour of metal, of matte, and of what light takes on when it passes", default=0.8,
                               at_most=1.0)  # fmt: skip
    metallic: Any = data("share of metal", default=0.0)
    roughness: Any = data("perceived roughness of the base", default=0.5)
    anisotropy: float = number("how much that depends on the direction", default=0.0, at_least=-1, at_most=1)
    anisotropy_rotation: float = number("of its direction from u, counter-clockwise", default=0.0, unit="degrees")
    ior: float = number("refractive index of the dielectric", default=1.5, at_least=1)
    dispersion: float = number("20 over the Abbe number of what is clear; 0: all wavelengths alike", default=0.0,
                               at_least=0)  # fmt: skip
    specular: Any = data("factor on what the opaque dielectric reflects colourlessly", default=1.0)
    clearcoat: Any = data("strength of the clear coat", default=0.0)
    clearcoat_roughness: Any = data("its perceived roughness", default=0.0)
    sheen: Any = textured("colour of the sheen", default=0.0, at_most=1.0)
    sheen_roughness: Any = data("its perceived roughness", default=0.3)
    transmission: Any = data("share of the dielectric that is clear below its surface", default=0.0)
    thin_walled: bool = flag("whether what is clear is a sheet, and not the boundary of a body", default=False)
    absorption: Color = color("absorption coefficient of the inside", default=0.0, unit="1/m")
    interior: Any = child("the medium inside; None for a clear or absorbing one", "media", default=None, optional=True,
                          packed=False)  # fmt: skip
    emission: Any = textured("radiance that the surface gives off by itself", default=0.0)
    _inside: Any = derived_child("the medium inside, if there is one", lambda p: p.inside())
    _stain: Any = derived_vector("its absorption as Whitted's model sees it",
                                 lambda p: stain(p) if p.inside() else (0.0,) * 3)  # fmt: skip
    _metal: Any = derived_array("energy that single reflections of metal lose",
                                lambda p: missing_of_mirrors(GGX, p.anisotropy))  # fmt: skip
    _varnish: Any = derived_array("what the dielectric reflects",
                                  lambda p: reflected_by_glass(GGX, 1.0 / p.ior, p.anisotropy))  # fmt: skip
    _coat: Any = derived_array("what the coat reflects", lambda p: p.coat())
    _sheen: Any = derived_array("what the sheen reflects", lambda p: sheen_table() if _there(p.sheen) else None)
    _glass_out: Any = derived_array("energy that single passages lose, from outside", lambda p: p.missing(1.0 / p.ior))
    _glass_in: Any = derived_array("and from inside", lambda p: p.missing(p.ior))
    _enters: Any = derived_number("share of light from all sides that enters",
                                  lambda p: passing(p.ior)[0])  # fmt: skip
    _leaves: Any = derived_number("and that leaves", lambda p: passing(p.ior)[1])
    _turn: Any = derived_vector("cosine and sine of the rotation", lambda p: (
        math.cos(math.radians(p.anisotropy_rotation)), math.sin(math.radians(p.anisotropy_rotation)), 0.0))  # fmt: skip
    _index: Any = derived_number("refractive index of what is clear at the d line", lambda p: max(p.ior, LEAST_INDEX))
    _indices: Any = derived_array("and by wavelength, if it differs; read as the word behind", lambda p: p.indices())

    def check(self) -> None:
        """Refuse absorption beside a medium."""
        check_body(self)

    @property
    def oriented(self) -> bool:
        return self.anisotropy != 0

    @property
    def translucent(self) -> bool:
        return _there(self.transmission)

    @property
    def filled(self) -> bool:
        return self.inside() is not None

    @property
    def thin(self) -> bool:
        return self.thin_walled

    @property
    def glow(self) -> float:
        if not isinstance(self.emission, tuple):
            return self.emission.brightness()
        return sum(self.emission) / 3

    @property
    def painted_glow(self) -> Any:
        return None if isinstance(self.emission, tuple) else self.emission

    def indices(self) -> Any:
        """The refractive index at `WAVELENGTHS`, (471,), or None; at least `LEAST_INDEX`."""
        if not (self.dispersion > 0.0 and _there(self.transmission)) or self.thin_walled:
            return None
        b = (self.ior - 1.0) * self.dispersion / 20.0 / (F_LINE**-2 - C_LINE**-2)
        return np.maximum(LEAST_INDEX, self.ior + b * (WAVELENGTHS**-2.0 - D_LINE**-2))

    def inside(self) -> Any:
        """The medium inside, or None; sheets have none, and neither have opaque bodies."""
        return None if self.thin_walled or not _there(self.transmission) else medium_inside(self)

    def coat(self) -> Any:
        """The table of energy.py for the clear coat, if there is one."""
        return reflected_by_glass(GGX, 1.0 / COAT_INDEX) if _there(self.clearcoat) else None

    def missing(self, eta: float) -> Any:
        """The table of energy.py for one side of what is clear, if anything is."""
        return (
            missing_of_glass(GGX, eta, self.anisotropy) if _there(self.transmission) and not self.thin_walled else None
        )


def _there(value: Any) -> bool:
    """Whether a colour or texture can be other than black."""
    return not isinstance(value, tuple) or bool(np.any(value))


(
    BASE_COLOR, METALLIC, ROUGHNESS, ANISOTROPY, _, IOR, _, SPECULAR, CLEARCOAT, CLEARCOAT_ROUGHNESS, SHEEN,
    SHEEN_ROUGHNESS, TRANSMISSION, THIN_WALLED, ABSORPTION, EMISSION, INSIDE, STAIN, METAL_TABLE, VARNISH_TABLE,
    COAT_TABLE, SHEEN_TABLE, GLASS_OUT, GLASS_IN, ENTERS, LEAVES, TURN, INDEX, _,
) = Principled.offsets()  # fmt: skip
SMOOTHEST = 0.0316  # roughness, for an alpha of 0.001: like a mirror, but lights without extent show in it


@kernel
def boundary_seen(material: Table, bands: Table, roughness: f64, outside: bool) -> Boundary:
    """The boundary of a clear body from the viewer's side; for others, one that is never asked."""
    out, within = table_at(material, GLASS_OUT), table_at(material, GLASS_IN)
    shape, ior = facets(GGX, roughness, f64_at(material, ANISOTROPY)), index_at(material, INDEX, bands)
    if is_null(out):
        return Boundary(shape, roughness, 1.0 / ior, out, within, 0.0)
    if outside:
        return boundary_of(shape, roughness, 1.0 / ior, out, within, f64_at(material, ENTERS))
    return boundary_of(shape, roughness, ior, within, out, f64_at(material, LEAVES))


@kernel
def layers_of(material: Table, where: Where, outside: bool) -> Layers:
    """All parameters at a place, from the viewer's side."""
    roughness = max(SMOOTHEST, share_of(table_at(material, ROUGHNESS), where))
    dielectric = 1.0 - share_of(table_at(material, METALLIC), where)
    clear = dielectric * share_of(table_at(material, TRANSMISSION), where)
    coat, fibres = table_at(material, COAT_TABLE), table_at(material, SHEEN_TABLE)
    iors = indices_at(material, INDEX, where.bands)
    return Layers(
        value_at(table_at(material, BASE_COLOR), where),
        1.0 - dielectric,
        dielectric - clear,
        clear,
        share_of(table_at(material, SPECULAR), where),
        1.0 / f64_at(material, IOR),
        boundary_seen(material, where.bands, roughness, outside),
        iors if outside else 1.0 / iors,
        disperses(material, INDEX, where.bands),
        i64_at(material, THIN_WALLED) != 0,
        1.0 - f64_at(material, ENTERS),
        0.0 if is_null(coat) else share_of(table_at(material, CLEARCOAT), where),
        max(SMOOTHEST, share_of(table_at(material, CLEARCOAT_ROUGHNESS), where)),
        grey(0.0) if is_null(fibres) else value_at(table_at(material, SHEEN), where),
        share_of(table_at(material, SHEEN_ROUGHNESS), where),
        table_at(material, METAL_TABLE),
        table_at(material, VARNISH_TABLE),
        coat,
        fibres,
    )


@kernel
def along_grain(material: Table, w: Vec3) -> Vec3:
    """A direction in the frame whose x is the direction of the anisotropy."""
    turn = vec3_at(material, TURN)
    return Vec3(turn.x * w.x + turn.y * w.y, turn.x * w.y - turn.y * w.x, w.z)


@kernel
def across_grain(material: Table, w: Vec3) -> Vec3:
    """A direction out of that frame again."""
    turn = vec3_at(material, TURN)
    return Vec3(turn.x * w.x - turn.y * w.y, turn.x * w.y + turn.y * w.x, w.z)


@implements(sample_bsdf, Principled)
def sample_principled(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    side = 1.0 if wo.z > 0.0 else -1.0
    layers = layers_of(material, where, wo.z > 0.0)
    o = along_grain(material, Vec3(wo.x, wo.y, wo.z * side))
    i = sample_layers(layers, o, u, v, choice)
    if i.z == 0.0:
        return BsdfSample(wo, grey(0.0), 0.0)
    found = layers_value(layers, where.bands, o, i)
    if not found.density > 0.0:  # seen exactly along the surface
        return BsdfSample(wo, grey(0.0), 0.0)
    if i.z < 0.0 and layers.parted:
        hero_only(where.bands)
    i = across_grain(material, i)
    return BsdfSample(Vec3(i.x, i.y, i.z * side), found.value / found.density, found.density)


@implements(bsdf, Principled)
def bsdf_of_principled(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    if wo.z == 0.0 or wi.z == 0.0:
        return BsdfValue(grey(0.0), 0.0)
    side = 1.0 if wo.z > 0.0 else -1.0
    layers = layers_of(material, where, wo.z > 0.0)
    o, i = Vec3(wo.x, wo.y, wo.z * side), Vec3(wi.x, wi.y, wi.z * side)
    return layers_value(layers, where.bands, along_grain(material, o), along_grain(material, i))


@implements(local, Principled)
def local_of_principled(material: Table, where: Where, cos_view: f64) -> Local:
    """Metal and the surface of the dielectric are mirrors, the coat is one more; sheen counts as matte."""
    outside = cos_view >= 0.0
    x = layers_of(material, where, outside)
    eta, alpha = 1.0 if x.thin else x.boundary.eta, x.boundary.shape.x
    cosine = softened(cos_view, alpha)
    share = fresnel(cosine, x.boundary.eta)
    varnish = x.specular * fresnel(cosine, x.eta)
    coat = x.coat * fresnel(abs(cos_view), 1.0 / COAT_INDEX)
    below = (1.0 - coat) * (1.0 - max4(x.sheen))
    mirror = (schlick(x.base, cosine) * x.metal + (varnish * x.opaque + share * x.clear)) * below + coat
    matte = x.base * (x.opaque * (1.0 - varnish) * below) + x.sheen * (1.0 - coat)
    absorption = grey(0.0) if outside else vec3_at(material, STAIN)
    emission = emitted_by_principled(material, where, cos_view)
    passed = x.base * (x.clear * (1.0 - share) * below)
    return glossy(x.base, emission, matte, mirror, passed, alpha, eta, absorption)


@implements(emitted, Principled)
def emitted_by_principled(material: Table, where: Where, cos_view: f64) -> Vec3:
    return texture_value(table_at(material, EMISSION), where)


@implements(interior, Principled)
def interior_of_principled(material: Table) -> Table:
    return table_at(material, INSIDE)


# ---------------------------------------------------------------------------------------------------- for eight paths


@kernel
def boundary8_of(
    material: Table, rows: I64x8, roughness: F64x8, outside: Mask8, clear: F64x8, metal: I64x8
) -> Boundary8:  # fmt: skip
    """The boundaries of what is clear, from the viewers' sides; `metal` in place of tables that are not there."""
    shape = facets8(0, roughness, gather8d(material, rows + ANISOTROPY))
    sheet, enters = gather8i(material, rows + THIN_WALLED) != 0, gather8d(material, rows + ENTERS)
    ior = select8d(sheet, gather8d(material, rows + IOR), gather8d(material, rows + INDEX))
    eta = select8d(outside | sheet, 1.0 / ior, ior)
    here, there, back = metal, metal, 1.0 - enters
    if movemask8((clear > 0.0) & not8(sheet)) != 0:
        out, within = tables8_or(material, rows, GLASS_OUT, metal), tables8_or(material, rows, GLASS_IN, metal)
        here, there = select8i(outside, out, within), select8i(outside, within, out)
        passed = select8d(outside, enters, gather8d(material, rows + LEAVES))
        back = select8d(sheet, back, back8(material, roughness, eta, here, there, passed))
    return Boundary8(shape, roughness, eta, here, there, back, sheet)


@kernel
def layers8_of(material: Table, rows: I64x8, outside: Mask8) -> Layers8:
    """`layers_of` for eight paths."""
    roughness = vmax8d(splat8d(SMOOTHEST), share8_of(material, rows, ROUGHNESS))
    dielectric = 1.0 - share8_of(material, rows, METALLIC)
    clear, metal = dielectric * share8_of(material, rows, TRANSMISSION), tables8(material, rows, METAL_TABLE)
    zero = splat8d(0.0)
    coat, coat_roughness, sheen, sheen_roughness = zero, zero, grey8(0.0), zero
    coated = gather8i(material, rows + COAT_TABLE) != 0
    if movemask8(coated) != 0:
        coat = select8d(coated, share8_of(material, rows, CLEARCOAT), zero)
        coat_roughness = vmax8d(splat8d(SMOOTHEST), share8_of(material, rows, CLEARCOAT_ROUGHNESS))
    fibrous = gather8i(material, rows + SHEEN_TABLE) != 0
    if movemask8(fibrous) != 0:
        sheen = select8v(fibrous, constant8(material, rows, SHEEN, COLOR), sheen)
        sheen_roughness = share8_of(material, rows, SHEEN_ROUGHNESS)
    return Layers8(
        constant8(material, rows, BASE_COLOR, COLOR),
        1.0 - dielectric,
        dielectric - clear,
        clear,
        share8_of(material, rows, SPECULAR),
        1.0 / gather8d(material, rows + IOR),
        boundary8_of(material, rows, roughness, outside, clear, metal),
        coat,
        coat_roughness,
        sheen,
        sheen_roughness,
        metal,
        tables8(material, rows, VARNISH_TABLE),
        tables8_or(material, rows, COAT_TABLE, metal),
        tables8_or(material, rows, SHEEN_TABLE, metal),
    )


@kernel
def turned8(material: Table, rows: I64x8, w: Vec3x8, side: F64x8, sense: f64) -> Vec3x8:
    """`along_grain` for a sense of 1, `across_grain` for -1; seen from the upper side."""
    c, s = gather8d(material, rows + TURN), gather8d(material, rows + (TURN + 1)) * sense
    return Vec3x8(c * w.x + s * w.y, c * w.y - s * w.x, w.z * side)


@implements(sample_eight, Principled)
def sample_principled_eight(
    material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8
) -> Sample8:  # fmt: skip
    outside = wo.z > 0.0
    side, layers = select8d(outside, splat8d(1.0), splat8d(-1.0)), layers8_of(material, rows, outside)
    o = turned8(material, rows, wo, side, 1.0)
    view = view8(material, layers, o)
    i = sample_layers8(layers, view, o, u, v, choice)
    found = layers_value8(material, layers, view, o, i)
    possible = (abs8d(i.z) > 0.0) & (found.density > 0.0)
    return Sample8(
        select8v(possible, turned8(material, rows, i, side, -1.0), wo),
        select8v(possible, found.value * (1.0 / found.density), grey8(0.0)),
        select8d(possible, found.density, splat8d(0.0)),
    )


@implements(bsdf_eight, Principled)
def bsdf_of_principled_eight(material: Table, rows: I64x8, wo: Vec3x8, wi: Vec3x8) -> Value8:
    outside = wo.z > 0.0
    side, layers = select8d(outside, splat8d(1.0), splat8d(-1.0)), layers8_of(material, rows, outside)
    o, i = turned8(material, rows, wo, side, 1.0), turned8(material, rows, wi, side, 1.0)
    found = layers_value8(material, layers, view8(material, layers, o), o, i)
    there = (abs8d(wo.z) > 0.0) & (abs8d(wi.z) > 0.0)
    return Value8(select8v(there, found.value, grey8(0.0)), select8d(there, found.density, splat8d(0.0)))
