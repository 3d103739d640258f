"""The contract of materials.

There are two views of a surface. For Whitted's model (T. Whitted, "An improved illumination model for shaded display",
CACM 1980) a material describes in `local` how its surface answers light at one point:

    I = emission + ambient * I_ambient + sum over lights of V * L * (diffuse * max(n.l, 0) + highlight)
        + mirror * I_reflected + transmission * I_refracted

`diffuse` multiplies irradiance, so a Lambertian surface states albedo / pi. The highlight is
``specular * cos^shininess`` of the angle between the viewer and the mirrored light (Phong) or between the normal and
the half vector (Blinn).

For path tracing it answers by its bidirectional scattering distribution function f. Directions `wo` (to the viewer) and
`wi` (to the light) are unit vectors that point away from the surface, in a frame whose z is the outward shading
normal: z is negative inside. `bsdf` gives f times |cos wi| and the density with which `sample_bsdf` would choose wi;
`sample_bsdf` chooses a direction with that density (per solid angle) and gives f |cos wi| / density. Mirrors and smooth
glass have a value only in `sample_bsdf`, with density 0. `emitted` is the radiance towards the viewer, in RGB, and
`interior` the medium inside. Colours come from `value_at(texture, where)` or `as_reflectance(where.bands, colour)`, so
that the same kernels serve RGB and spectral paths.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

from sightray._jit import implements, kernel, method
from sightray.mathlib.bands import as_light
from sightray.mathlib.eight_paths import grey8
from sightray.mathlib.eights import F64x8, I64x8, Vec3x8, splat8d
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, is_null, no_table
from sightray.mathlib.vec import Vec3, grey
from sightray.registry import Member
from sightray.textures.base import Texture, Where

PHONG, BLINN = 0, 1


class Local(NamedTuple):
    """How a surface answers light at a point, in Whitted's terms; see the formula of this module."""

    color: Vec3  # plain colour, as ray casting without lights shows it
    emission: Vec3
    ambient: Vec3
    diffuse: Vec3
    specular: Vec3
    shininess: f64
    highlight: i64  # PHONG or BLINN
    mirror: Vec3
    transmission: Vec3
    eta: f64  # refractive index before the surface over the one behind it, along the ray
    absorption: Vec3  # of the medium that the ray came through, per metre


class BsdfSample(NamedTuple):
    """A direction that light may have come from."""

    wi: Vec3
    weight: Vec3  # f(wo, wi) |cos wi| / density
    density: f64  # per solid angle; 0 where the direction is the only one possible (mirrors, smooth glass), or none is


class BsdfValue(NamedTuple):
    """What a surface makes of light from one direction."""

    value: Vec3  # f(wo, wi) |cos wi|
    density: f64  # with which `sample_bsdf` chooses wi, per solid angle


class Sample8(NamedTuple):
    """`BsdfSample` for eight paths."""

    wi: Vec3x8
    weight: Vec3x8
    density: F64x8


class Value8(NamedTuple):
    """`BsdfValue` for eight paths."""

    value: Vec3x8
    density: F64x8


class Way(NamedTuple):
    """What a unit of u is on the surface, and as long a way across it towards growing v."""

    stretch: f64  # its length in the world, metres; 0 where u does not run
    along: Vec3  # in the space of the shape
    across: Vec3


class Material(Member, family="materials"):
    """Base of all materials. Unless a member says otherwise it reflects, emits and absorbs nothing.

    What a material is beside a plain surface is stated for the compiler, which spares the others the question:
    `cutout` (it has holes: `opacity`), `bumpy` (it bends normals: `bent_normal`), `oriented` (its answers depend on
    the direction of the tangent, so the frame's x must be along it), `clear` (light passes straight through, as
    through the bare boundary of a fog: shadow rays go on behind it), `thin` (a sheet: light that passes is inside of
    nothing), `translucent` (light from behind shows: `bsdf` is not zero across the surface), `patterned` (it asks
    textures, which want to know how wide the ray is and which way the surface faces in object space).
    """

    chooses: ClassVar[bool] = True  # whether `sample_eight` asks for `choice`

    @property
    def cutout(self) -> bool:
        """Whether it has holes."""
        return False

    @property
    def bumpy(self) -> bool:
        """Whether it bends shading normals."""
        return False

    @property
    def oriented(self) -> bool:
        """Whether the direction of the tangent matters."""
        return False

    @property
    def glow(self) -> float:
        """About how much radiance it gives off, mean of its colours: for choosing among lamps; 0 if it is dark."""
        return 0.0

    @property
    def painted_glow(self) -> Any:
        """The texture of the radiance that it gives off, if that is one: for choosing among the parts of a lamp."""
        return None

    @property
    def clear(self) -> bool:
        """Whether light passes straight through."""
        return False

    @property
    def translucent(self) -> bool:
        """Whether light from behind counts in `bsdf`."""
        return False

    @property
    def patterned(self) -> bool:
        """Whether it has textures that are not the same everywhere."""
        return any(_differs(value) for value in self.values().values())

    @property
    def filled(self) -> bool:
        """Whether a medium is inside."""
        return False

    @property
    def thin(self) -> bool:
        """Whether it is a sheet with the same medium on both sides, such as a pane or a leaf."""
        return False

    @property
    def bare(self) -> Material:
        """What answers light: the material without what only bends its normals or cuts holes into it."""
        return self


def _differs(value: Any) -> bool:
    """Whether a field's value is a texture, or a material with one, that is not the same everywhere."""
    from sightray.textures.constant import Constant

    if isinstance(value, Material):
        return value.patterned
    return isinstance(value, Texture) and not isinstance(value, Constant)


@method(0)
def local(material: Table, where: Where, cos_view: f64) -> Local:
    """The surface's answer at a place. `cos_view`: viewer and outward normal; negative when seen from inside."""
    raise NotImplementedError


@method(1)
def sample_bsdf(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    """Choose a direction to go on in, by three uniform numbers."""
    raise NotImplementedError


@method(2)
def bsdf(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    """Value and density of a pair of directions."""
    raise NotImplementedError


@method(3)
def emitted(material: Table, where: Where, cos_view: f64) -> Vec3:
    """Radiance that the surface gives off towards the viewer."""
    raise NotImplementedError


@method(4)
def interior(material: Table) -> Table:
    """The medium inside; no table where nothing gets inside, or nothing is there."""
    raise NotImplementedError


@method(5)
def opacity(material: Table, where: Where) -> f64:
    """Share of light that meets the surface at all, 0 to 1; only materials with `cutout` are asked."""
    raise NotImplementedError


@method(6)
def bent_normal(material: Table, where: Where, way: Way) -> Vec3:
    """Shading normal, unit, in the frame of tangent (x), bitangent (y) and normal (z); only `bumpy` ones are asked."""
    raise NotImplementedError


@method(7)
def glow_in_lanes(material: Table, bands: Table, rgb: Vec3) -> Vec3:
    """Light that the material gave off, and that is known as RGB, at the wavelengths of a spectral path."""
    raise NotImplementedError


@implements(glow_in_lanes, Material)
def up_sampled(material: Table, bands: Table, rgb: Vec3) -> Vec3:
    return as_light(bands, rgb)


@method(8, form_of=(sample_bsdf, bsdf))
def sample_eight(
    material: Table, rows: I64x8, wo: Vec3x8, u: F64x8, v: F64x8, choice: F64x8
) -> Sample8:  # fmt: skip
    """`sample_bsdf` for eight paths at materials of one class, in RGB; textures are constant.

    `rows` says how many words it is from `material` to each path's own material. Members that have this and `bsdf_eight`
    are rendered eight paths at a time (`integrators.eightpaths`); the others need neither.
    """
    raise NotImplementedError


@method(9, form_of=(bsdf,))
def bsdf_eight(material: Table, rows: I64x8, wo: Vec3x8, wi: Vec3x8) -> Value8:
    """`bsdf` for eight paths."""
    raise NotImplementedError


@implements(bsdf_eight, Material)
def reflect_nothing_eight(material: Table, rows: I64x8, wo: Vec3x8, wi: Vec3x8) -> Value8:
    return Value8(grey8(0.0), splat8d(0.0))


@kernel
def glow_in(bands: Table, material: Table, rgb: Vec3) -> Vec3:
    """Light that a material gave off, in the path's lanes."""
    return rgb if is_null(bands) else glow_in_lanes(material, bands, rgb)


@implements(sample_bsdf, Material)
def sample_nothing(material: Table, where: Where, wo: Vec3, u: f64, v: f64, choice: f64) -> BsdfSample:
    return BsdfSample(wo, grey(0.0), 0.0)


@implements(bsdf, Material)
def reflect_nothing(material: Table, where: Where, wo: Vec3, wi: Vec3) -> BsdfValue:
    return BsdfValue(grey(0.0), 0.0)


@implements(emitted, Material)
def emit_nothing(material: Table, where: Where, cos_view: f64) -> Vec3:
    return grey(0.0)


@implements(interior, Material)
def nothing_inside(material: Table) -> Table:
    return no_table()


@implements(opacity, Material)
def opaque(material: Table, where: Where) -> f64:
    return 1.0


@implements(bent_normal, Material)
def straight_normal(material: Table, where: Where, way: Way) -> Vec3:
    return Vec3(0.0, 0.0, 1.0)
