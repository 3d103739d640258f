"""The layers of `layers`, for eight paths at once. A part that no path of the eight has costs nothing."""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import kernel
from sightray.materials.base import Value8
from sightray.materials.eight_boundaries import Boundary8, by_facet8, pass_boundary8
from sightray.materials.eight_facets import Facets8, Facing8, facets8, facing8, sample_facet8, upward8
from sightray.materials.eight_missing import (
    in_plane8,
    mean_share8,
    sample_spread8,
    share_at8,
    spread_density8,
    spread_over8,
    varnish_share8,
)
from sightray.materials.layers import COAT_INDEX
from sightray.materials.sheen import BEND, SMOOTHEST
from sightray.mathlib.eight_functions import pow8
from sightray.mathlib.eight_paths import brightest8, fresnel8, grey8, normalize8, plus8, quotient8
from sightray.mathlib.eights import (
    F64x8,
    I64x8,
    Vec3x8,
    dot8,
    not8,
    select8d,
    select8v,
    splat8d,
    vmax8d,
    vmin8d,
)
from sightray.mathlib.lanes import Mask8, movemask8
from sightray.mathlib.table import Table


class Layers8(NamedTuple):
    """`Layers` for eight paths."""

    base: Vec3x8
    metal: F64x8
    opaque: F64x8
    clear: F64x8
    specular: F64x8
    eta: F64x8
    boundary: Boundary8
    coat: F64x8
    coat_roughness: F64x8
    sheen: Vec3x8
    sheen_roughness: F64x8
    metal_table: I64x8  # tables, see eight_missing.py
    varnish_table: I64x8
    coat_table: I64x8
    sheen_table: I64x8


class View8(NamedTuple):
    """What the viewer's direction decides: the odds of `layers.Odds`, and shares of the tables."""

    by_coat: F64x8
    by_gloss: F64x8
    by_bounces: F64x8
    by_matte: F64x8
    by_clear: F64x8
    lost: F64x8  # of metal
    lost_at_boundary: F64x8
    varnish: F64x8
    coat: F64x8
    fibres: F64x8


@kernel
def schlick8(base: Vec3x8, cosine: F64x8) -> Vec3x8:
    """`layers.schlick`."""
    c = 1.0 - cosine
    c5 = c * c * (c * c) * c
    return Vec3x8(base.x + (1.0 - base.x) * c5, base.y + (1.0 - base.y) * c5, base.z + (1.0 - base.z) * c5)


@kernel
def sheen_share8(material: Table, x: Layers8, w: Vec3x8) -> F64x8:
    """What a table of the sheen says, not limited to 1."""
    return in_plane8(material, x.sheen_table + 1, x.sheen_roughness, splat8d(BEND), w.z)


@kernel
def coat_share8(material: Table, x: Layers8, w: Vec3x8) -> F64x8:
    """What the coat reflects, were it there in full."""
    return varnish_share8(material, x.coat_table, x.coat_roughness, splat8d(1.0 / COAT_INDEX), w)


@kernel
def view8(material: Table, x: Layers8, o: Vec3x8) -> View8:
    """`layers.odds_of`, and the shares that it takes."""
    one, zero, r = splat8d(1.0), splat8d(0.0), x.boundary.roughness
    coat_share, fibres_share, fibres = zero, zero, brightest8(x.sheen)
    if movemask8(x.coat > 0.0) != 0:
        coat_share = coat_share8(material, x, o)
    if movemask8(fibres > 0.0) != 0:
        fibres_share = sheen_share8(material, x, o)
    coat, fibres = x.coat * coat_share, fibres * vmin8d(one, fibres_share)
    lost, varnish_share = zero, zero
    if movemask8((x.metal > 0.0) | (x.clear > 0.0)) != 0:
        lost = share_at8(material, x.metal_table, r, o)
    if movemask8(x.opaque > 0.0) != 0:
        varnish_share = varnish_share8(material, x.varnish_table, r, x.eta, o)
    lost_at_boundary = lost
    if movemask8((x.clear > 0.0) & not8(x.boundary.sheet)) != 0:
        lost_at_boundary = select8d(x.boundary.sheet, lost, share_at8(material, x.boundary.here, r, o))
    metal = x.metal * brightest8(schlick8(x.base, o.z))
    varnish = x.specular * varnish_share
    below = (1.0 - coat) * (1.0 - fibres)
    gloss = below * (metal * (1.0 - lost) + x.opaque * varnish)
    matte = below * x.opaque * (1.0 - varnish) * brightest8(x.base) + (1.0 - coat) * fibres
    total = coat + gloss + below * (metal * lost + x.clear) + matte
    any = total > 0.0
    share = select8d(any, 1.0 / total, zero)
    return View8(
        coat * share, gloss * share, below * metal * lost * share, select8d(any, matte * share, one),
        below * x.clear * share, lost, lost_at_boundary, varnish_share, coat_share, fibres_share,
    )  # fmt: skip


@kernel
def sample_layers8(x: Layers8, view: View8, o: Vec3x8, u: F64x8, v: F64x8, choice: F64x8) -> Vec3x8:
    """`layers.sample_layers`."""
    # Who chooses what.
    clear = choice < view.by_clear
    of_clear, rest = choice / view.by_clear, choice - view.by_clear
    matte = not8(clear) & (rest < view.by_matte)
    rest = rest - view.by_matte
    bounces = not8(clear | matte) & (rest < view.by_bounces)
    coat = not8(clear | matte | bounces) & not8(rest - view.by_bounces < view.by_gloss)

    # Light that is spread, on either side.
    lost, b = view.lost_at_boundary, x.boundary
    lost_of_clear = clear & (of_clear < lost)
    spread, found = matte | bounces | lost_of_clear, grey8(0.0)
    if movemask8(spread) != 0:
        found = sample_spread8(b.roughness, u, v, matte)
        down = lost_of_clear & not8(of_clear < lost * b.back)
        found = Vec3x8(found.x, found.y, select8d(down, -found.z, found.z))

    # Light by facets.
    if movemask8(not8(spread)) != 0:
        shape = b.shape
        if movemask8(coat) != 0:
            varnish = facets8(0, x.coat_roughness, splat8d(0.0))
            shape = Facets8(0, select8d(coat, varnish.x, shape.x), select8d(coat, varnish.y, shape.y))
        m = sample_facet8(shape, o, u, v)
        share = fresnel8(dot8(o, m), b.eta)
        mirrors = not8(clear) | (of_clear - lost < (1.0 - lost) * share)
        found = select8v(spread, found, by_facet8(b, o, m, mirrors))
    return found


@kernel
def layers_value8(material: Table, x: Layers8, view: View8, o: Vec3x8, i: Vec3x8) -> Value8:
    """`layers.layers_value`."""
    above, up, zero = i.z > 0.0, upward8(i), splat8d(0.0)
    facing = facing8(x.boundary.shape, o, up)
    found = opaque_value8(material, x, view, facing, up)
    value, density = select8v(above, found.value, grey8(0.0)), select8d(above, found.density, zero)
    if movemask8(x.clear > 0.0) != 0:
        passage = pass_boundary8(material, x.boundary, view.lost_at_boundary, facing, o, i)
        light = select8d(x.clear > 0.0, x.clear * passage.value, zero)
        value = value + select8v(above, grey8(1.0), x.base) * light
        density = density + select8d(view.by_clear > 0.0, view.by_clear * passage.density, zero)
    if movemask8(brightest8(x.sheen) > 0.0) != 0:
        value = below_sheen8(material, x, view, o, i, value)
    if movemask8(x.coat > 0.0) != 0:
        return below_coat8(material, x, view, o, up, above, Value8(value, density))
    return Value8(value, density)


@kernel
def opaque_value8(material: Table, x: Layers8, view: View8, facing: Facing8, i: Vec3x8) -> Value8:
    """Metal, varnish, and what is matte below; `i` is above the surface."""
    r, value = x.boundary.roughness, grey8(0.0)
    density = view.by_matte * i.z * (1.0 / math.pi) + view.by_gloss * facing.density
    if movemask8(x.metal > 0.0) != 0:
        mean = mean_share8(material, x.metal_table, r)
        f = plus8(x.base * (20.0 / 21.0), splat8d(1.0 / 21.0))  # the mean of Schlick's reflectance
        many = quotient8(f * f * (1.0 - mean), plus8(-(f * mean), splat8d(1.0)))
        many = many * spread_over8(material, x.metal_table, r, view.lost, i)
        value = (schlick8(x.base, facing.cosine) * facing.once + many) * x.metal
        density = density + view.by_bounces * spread_density8(r, i.z)
    if movemask8(x.opaque > 0.0) != 0:
        s = x.specular
        varnish = varnish_share8(material, x.varnish_table, r, x.eta, i)
        reflected = (1.0 - s * view.varnish) * (1.0 - s * varnish)
        matte = reflected * i.z / ((1.0 - s * mean_share8(material, x.varnish_table, r)) * math.pi)
        gloss = s * fresnel8(facing.cosine, x.eta) * facing.once
        value = value + plus8(x.base * matte, gloss) * x.opaque
    return Value8(value, density)


@kernel
def below_sheen8(material: Table, x: Layers8, view: View8, o: Vec3x8, i: Vec3x8, value: Vec3x8) -> Vec3x8:
    """What is seen through the fibres of a sheen, and those."""
    share, one = sheen_share8(material, x, i), splat8d(1.0)
    found = value * (1.0 - brightest8(x.sheen) * vmin8d(one, vmax8d(view.fibres, share)))
    m = normalize8(o + i)
    root = vmax8d(splat8d(SMOOTHEST), x.sheen_roughness)
    sharp = 1.0 / (root * root)
    density = (2.0 + sharp) * (0.5 / math.pi) * pow8(vmax8d(splat8d(0.0), 1.0 - m.z * m.z), 0.5 * sharp)
    most = vmax8d(one, vmax8d(view.fibres, share))
    fibres = x.sheen * (density * i.z / (4.0 * (o.z + i.z - o.z * i.z) * most))
    there = (i.z > 0.0) & (brightest8(x.sheen) > 0.0)
    return select8v(there, found + fibres, found)


@kernel
def below_coat8(
    material: Table, x: Layers8, view: View8, o: Vec3x8, up: Vec3x8, above: Mask8, found: Value8
) -> Value8:  # fmt: skip
    """What is seen through the clear coat, and that."""
    share, eta = vmax8d(view.coat, coat_share8(material, x, up)), splat8d(1.0 / COAT_INDEX)
    value, there = found.value * (1.0 - x.coat * share), above & (x.coat > 0.0)
    facing = facing8(facets8(0, x.coat_roughness, splat8d(0.0)), o, up)
    light = x.coat * fresnel8(facing.cosine, eta) * facing.once
    density = found.density + view.by_coat * facing.density
    return Value8(select8v(there, plus8(value, light), value), select8d(there, density, found.density))
