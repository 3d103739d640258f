"""The walks of `path`, eight side by side, in any scene without media.

Rays are sent through the tree one after the other, and what a surface is like at a place is looked up one by one: these
are loads and branches, in which lanes would only wait for each other. What follows is arithmetic, and is done for eight
at once: the choice of directions and lights, what materials make of them, and all random numbers.
"""

from __future__ import annotations

import math

from sightray._jit import implements, kernel, method
from sightray.accelerators.item import ORIENTED, PATTERNED, ItemHit
from sightray.cameras.base import APART
from sightray.cameras.base import SPREAD as CAMERA_SPREAD
from sightray.integrators.base import LINE, SAMPLE, TIME, Batch, radiance_of_batch
from sightray.integrators.direct import lit_normal
from sightray.integrators.eightpaths import (
    BEGIN,
    BETA,
    COLOR,
    DENSITY,
    GOES,
    MORE,
    START,
    Onward8,
    Sent8,
    Surface8,
    Taken,
    Way8,
    bsdf_of_kinds,
    enter8,
    go_on8,
    keep_lines,
    keep_paths,
    lamp8,
    limited8,
    lit_by8,
    load_paths,
    sample_of_kinds,
    way8,
    with_skies,
    write_found,
)
from sightray.integrators.path import DEPTH, LIGHT_SAMPLES, LOBE, WIDEST, PathTracer, given_off, limited
from sightray.integrators.shading import frame_of
from sightray.integrators.terminator import lifted
from sightray.lights.base import LightSample8
from sightray.materials.base import Sample8, Value8, bsdf, sample_bsdf
from sightray.mathlib.eight_paths import (
    Frame8,
    frame_about8,
    grey8,
    into8,
    lane_at,
    lines_at,
    load8v,
    out_of8,
    put_lane,
    put_lines,
    store8v,
)
from sightray.mathlib.eights import (
    F64x8,
    Vec3x8,
    abs8d,
    dot8,
    load8d,
    load8i,
    mask8,
    not8,
    select8d,
    select8v,
    splat8d,
    splat8i,
    sqrt8d,
    store8d,
    store8i,
    store_chosen8d,
    vmax8d,
    vmin8d,
    whole8d,
)
from sightray.mathlib.lanes import Mask8, count_bits, lowest_bit, movemask8
from sightray.mathlib.scalars import i64
from sightray.mathlib.table import (
    Table,
    advance,
    f64_at,
    f64_put,
    i64_at,
    i64_put,
    no_table,
    scratch,
    table_at,
    table_put,
    vec3_at,
    vec3_put,
)
from sightray.mathlib.vec import Vec3
from sightray.samplers.base import nested8, one_of8
from sightray.scene.kinds import ALONE, GLOWING, KIND_OF, MATERIAL_OF, NUMBER, ROOM, kinds_of, settle
from sightray.scene.world import CAMERA, FLAGS, Beam, find_closest, is_blocked, light_count, on_seen_side, point_of
from sightray.textures.base import Where

# What is known of a path besides: the normal where its ray began (see `direct.lit_normal`), how wide the ray is there and
# how fast it widens, its moment; then what the ray has met.
LIT, WIDTH, SPREAD, ITS_TIME = MORE, MORE + 3 * LINE, MORE + 4 * LINE, MORE + 5 * LINE
HIT_T, HIT_ITEM, HIT_PRIM, HIT_U, HIT_V = (MORE + k * LINE for k in range(6, 11))
assert MORE + 11 * LINE == 3944  # as `radiance_of_paths` has it

# Words that surfaces are looked up into, for eight lanes: point, geometric and shading normal, where shadow rays begin, the
# side that is lit, two axes of the frame, class and row of the material; then a row of each for what has textures, and the
# place on each surface for materials that are asked alone.
P, NORMAL, SHADING, LIFTED, SIDE, AXIS_S, AXIS_T, KIND, MATERIAL, ROOMS = 0, 24, 48, 72, 96, 120, 144, 168, 176, 184
WHERES, WHERE_WORDS = ROOMS + 8 * ROOM, 12
assert WHERES + 8 * WHERE_WORDS == 1368  # as `step8` has it
NOTHING, OTHER = -1, -2  # instead of classes: where no surface is, and where the material has no forms for eight paths


class _AmongTrees(PathTracer):
    """`PathTracer` for scenes whose surfaces are found by a tree; all materials have forms for eight paths."""


class _AmongOthers(_AmongTrees):
    """The same for scenes in which some materials have none: a class of its own, so that others need not compile theirs."""


@method(3)
def sample_others(integrator: Table, words: Table, wo: Vec3x8, way: Way8, known: Sample8, bits: i64) -> Sample8:
    """`sample_of_kinds` for the `OTHER` materials, in the lanes of `bits`, one by one; what is known is kept."""
    raise NotImplementedError


@method(4)
def bsdf_others(integrator: Table, words: Table, wo: Vec3x8, wi: Vec3x8, known: Value8, bits: i64) -> Value8:
    """`bsdf_of_kinds` for the same."""
    raise NotImplementedError


@implements(sample_others, _AmongTrees)
def no_other_samples(integrator: Table, words: Table, wo: Vec3x8, way: Way8, known: Sample8, bits: i64) -> Sample8:
    return known


@implements(bsdf_others, _AmongTrees)
def no_other_values(integrator: Table, words: Table, wo: Vec3x8, wi: Vec3x8, known: Value8, bits: i64) -> Value8:
    return known


@implements(radiance_of_batch, _AmongTrees)
def radiance_of_paths(integrator: Table, world: Table, batch: Batch) -> i64:
    paths, count = scratch(3944), batch.size
    for k in range(0, count, 8):
        enter8(paths, batch.lines, k)
        widen8(world, paths, batch, k)
    rays, event = 0, 0
    while count > 0:
        left = 0
        for k in range(count):
            meet(world, paths, k)
        for k in range(0, count, 8):
            taken = step8(integrator, world, paths, batch, k, mask8((1 << min(8, count - k)) - 1), event, left)
            left, rays = taken.left, rays + taken.rays
        count = left
        event += 1
    return rays


@kernel
def widen8(world: Table, paths: Table, batch: Batch, k: i64) -> None:
    """How wide the rays of sight of eight paths are, from number k on; see `world.sight_beam`."""
    camera = table_at(world, CAMERA)
    taken = vmax8d(whole8d(load8i(batch.lines, SAMPLE + k) + 1), splat8d(float(batch.samples)))
    share = 1.0 / sqrt8d(taken)
    store8d(paths, WIDTH + k, share * f64_at(camera, APART))
    store8d(paths, SPREAD + k, share * f64_at(camera, CAMERA_SPREAD))
    put_lines(paths, LIT + k, LINE, grey8(0.0))
    store8d(paths, ITS_TIME + k, load8d(batch.lines, TIME + k))


@kernel
def line_at(paths: Table, index: i64) -> Vec3:
    """A vector of one path."""
    return Vec3(f64_at(paths, index), f64_at(paths, index + LINE), f64_at(paths, index + 2 * LINE))


@kernel
def start_of(paths: Table, k: i64) -> Vec3:
    """Where the ray of path number k begins, and when."""
    o = line_at(paths, START + k)
    return Vec3(o.x, o.y, o.z, f64_at(paths, ITS_TIME + k))


@kernel
def meet(world: Table, paths: Table, k: i64) -> None:
    """Send the ray of path number k to its nearest surface."""
    hit = find_closest(world, start_of(paths, k), line_at(paths, GOES + k), f64_at(paths, BEGIN + k), math.inf)
    f64_put(paths, HIT_T + k, hit.t)
    i64_put(paths, HIT_ITEM + k, hit.item)
    i64_put(paths, HIT_PRIM + k, hit.prim)
    f64_put(paths, HIT_U + k, hit.u)
    f64_put(paths, HIT_V + k, hit.v)


@kernel
def look_up(integrator: Table, world: Table, paths: Table, k: i64, words: Table, lane: i64, event: i64) -> None:
    """What the surface is like that path number k has met, as lane number `lane` of `words`; what it gives off is added."""
    hit = ItemHit(
        f64_at(paths, HIT_T + k), i64_at(paths, HIT_ITEM + k), i64_at(paths, HIT_PRIM + k), f64_at(paths, HIT_U + k),
        f64_at(paths, HIT_V + k),
    )  # fmt: skip
    o, d = start_of(paths, k), line_at(paths, GOES + k)
    beam = Beam(f64_at(paths, WIDTH + k), f64_at(paths, SPREAD + k), no_table())
    point = on_seen_side(point_of(world, hit, o, d, beam), d)
    put_lane(words, P + lane, point.p)
    put_lane(words, NORMAL + lane, point.normal)
    put_lane(words, SHADING + lane, point.shading)
    put_lane(words, SIDE + lane, lit_normal(point))
    if i64_at(world, FLAGS) & ORIENTED != 0:
        frame = frame_of(point)
        put_lane(words, AXIS_S + lane, frame.s)
        put_lane(words, AXIS_T + lane, frame.t)
    if light_count(world) > 0:
        put_lane(words, LIFTED + lane, lifted(world, hit, point))
    kinds = kinds_of(world)
    number, row = i64_at(table_at(kinds, KIND_OF), hit.item), table_at(table_at(kinds, MATERIAL_OF), hit.item)
    if number & GLOWING != 0:
        lit, density = line_at(paths, LIT + k), f64_at(paths, DENSITY + k)
        light = line_at(paths, BETA + k) * given_off(world, point, o, lit, d, hit.t, density, no_table())
        found = line_at(paths, COLOR + k) + limited(integrator, light, event)
        f64_put(paths, COLOR + k, found.x)
        f64_put(paths, COLOR + LINE + k, found.y)
        f64_put(paths, COLOR + 2 * LINE + k, found.z)
    if number & ALONE != 0:
        put_where(advance(words, WHERES + lane * WHERE_WORDS), point.where)
        i64_put(words, KIND + lane, OTHER)
    else:
        i64_put(words, KIND + lane, number & NUMBER)
        if point.flags & PATTERNED != 0:
            room = advance(words, ROOMS + lane * ROOM)
            settle(kinds, number & NUMBER, row, point.where, room)
            row = room
    table_put(words, MATERIAL + lane, row)


@kernel
def put_where(words: Table, where: Where) -> None:
    """Write a place on a surface."""
    vec3_put(words, 0, where.p)
    vec3_put(words, 4, where.normal)
    f64_put(words, 8, where.u)
    f64_put(words, 9, where.v)
    f64_put(words, 10, where.width)


@kernel
def where_at(words: Table, lane: i64) -> Where:
    """The place on the surface in a lane."""
    at = advance(words, WHERES + lane * WHERE_WORDS)
    return Where(f64_at(at, 8), f64_at(at, 9), vec3_at(at, 0), vec3_at(at, 4), f64_at(at, 10), no_table())


@kernel
def step8(
    integrator: Table, world: Table, lines: Table, batch: Batch, first: i64, chosen: Mask8, event: i64, left: i64
) -> Taken:
    """Go on with eight paths, from number `first` on, where they have met something; see `eightpieces.step8`."""
    words = scratch(1368)
    store8i(words, KIND, splat8i(NOTHING))
    going = chosen & (load8i(lines, HIT_ITEM + first) >= 0)
    missed, rays = chosen & not8(going), count_bits(movemask8(chosen))
    bits = movemask8(going)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        look_up(integrator, world, lines, first + k, words, k, event)
    paths = load_paths(lines, first, batch)
    color = paths.found
    if movemask8(missed) != 0:
        sent = Sent8(paths.o, lines_at(lines, LIT + first, LINE), paths.d, paths.density, paths.beta)
        color = with_skies(integrator, world, sent, color, missed, event)
    if event >= i64_at(integrator, DEPTH) or movemask8(going) == 0:
        write_found(batch.lines, paths.place, color, movemask8(chosen))
        return Taken(left, rays)

    # Choose where to go on, and whether to.
    own, p, t = nested8(paths.draws, event), load8v(words, P), load8d(lines, HIT_T + first)
    frame = frame_about8(load8v(words, SHADING))
    if i64_at(world, FLAGS) & ORIENTED != 0:
        frame = Frame8(load8v(words, AXIS_S), load8v(words, AXIS_T), frame.n)
    wo = into8(frame, -paths.d)
    size = vmax8d(vmax8d(abs8d(p.x), abs8d(p.y)), abs8d(p.z))
    t_min = vmax8d(t, size) * 1e-9
    here = Surface8(p, load8v(words, SIDE), load8i(words, KIND), load8i(words, MATERIAL), t_min, frame, wo)
    others = movemask8(here.kind == OTHER)
    way = way8(integrator, world, own, event)
    next = sample_of_kinds(kinds_of(world), here, way)
    if others != 0:
        next = sample_others(integrator, words, wo, way, next, others)
    onward = go_on8(integrator, next, way, paths.beta, going, event)

    # Look for lights.
    count = i64_at(integrator, LIGHT_SAMPLES) if event == 0 else 1
    for k in range(count if light_count(world) > 0 else 0):
        lamp = lamp8(world, here, one_of8(own, k, count), going)
        wi = into8(frame, lamp.sample.direction)
        answer = bsdf_of_kinds(kinds_of(world), here, wi)
        if others != 0:
            answer = bsdf_others(integrator, words, wo, wi, answer, others)
        lit = lit_by8(here, lamp, answer, going)
        asked = count_bits(movemask8(lit.asked))
        if asked > 0:
            start = select8v(wo.z * wi.z < 0.0, p, load8v(words, LIFTED))
            bright = unblocked8(world, here, start, load8d(lines, ITS_TIME + first), lamp.sample, lit.asked)
            brought = limited8(integrator, paths.beta * lit.light, event + 1) * (1.0 / count)
            color = select8v(bright, color + brought, color)
            rays += asked

    write_found(batch.lines, paths.place, color, movemask8(chosen & not8(onward.on)))
    passes = wo.z * onward.next.wi.z < 0.0
    d = on_true_side8(load8v(words, NORMAL), paths.d, out_of8(frame, onward.next.wi), passes)
    widen_on8(lines, first, left, onward, t)
    keep_lines(lines, LIT + left, here.lit, onward.on)
    store_chosen8d(lines, ITS_TIME + left, load8d(lines, ITS_TIME + first), onward.on)
    keep_paths(lines, left, paths, p, d, onward, color, t_min)
    return Taken(left + count_bits(movemask8(onward.on)), rays)


@kernel
def widen_on8(lines: Table, first: i64, left: i64, onward: Onward8, t: F64x8) -> None:
    """How wide the rays are that go on; see `path.onward`."""
    width, spread = load8d(lines, WIDTH + first), load8d(lines, SPREAD + first)
    density = onward.next.density
    lobe = LOBE / sqrt8d(vmax8d(density, splat8d(1e-300)))
    wider = vmin8d(splat8d(WIDEST), vmax8d(spread, lobe))
    store_chosen8d(lines, WIDTH + left, width + spread * t, onward.on)
    store_chosen8d(lines, SPREAD + left, select8d(density <= 0.0, spread, wider), onward.on)


@kernel
def on_true_side8(normal: Vec3x8, d: Vec3x8, way: Vec3x8, passes: Mask8) -> Vec3x8:
    """`shading.on_true_side` for eight paths."""
    facing = dot8(normal, way)
    through = facing * dot8(normal, d) > 0.0
    right = (through & passes) | not8(through | passes)
    return select8v(right, way, way - normal * (2.0 * facing))


@implements(sample_others, _AmongOthers)
def sample_one_by_one(integrator: Table, words: Table, wo: Vec3x8, way: Way8, known: Sample8, bits: i64) -> Sample8:
    mine = scratch(104)
    store8v(mine, 0, wo)
    store8d(mine, 24, way.turn.u)
    store8d(mine, 32, way.turn.v)
    store8d(mine, 40, way.choice.u)
    store8v(mine, 48, known.wi)
    store8v(mine, 72, known.weight)
    store8d(mine, 96, known.density)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        material, where = table_at(words, MATERIAL + k), where_at(words, k)
        u, v, choice = f64_at(mine, 24 + k), f64_at(mine, 32 + k), f64_at(mine, 40 + k)
        found = sample_bsdf(material, where, lane_at(mine, k), u, v, choice)
        put_lane(mine, 48 + k, found.wi)
        put_lane(mine, 72 + k, found.weight)
        f64_put(mine, 96 + k, found.density)
    return Sample8(load8v(mine, 48), load8v(mine, 72), load8d(mine, 96))


@implements(bsdf_others, _AmongOthers)
def bsdf_one_by_one(integrator: Table, words: Table, wo: Vec3x8, wi: Vec3x8, known: Value8, bits: i64) -> Value8:
    mine = scratch(80)
    store8v(mine, 0, wo)
    store8v(mine, 24, wi)
    store8v(mine, 48, known.value)
    store8d(mine, 72, known.density)
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        found = bsdf(table_at(words, MATERIAL + k), where_at(words, k), lane_at(mine, k), lane_at(mine, 24 + k))
        put_lane(mine, 48 + k, found.value)
        f64_put(mine, 72 + k, found.density)
    return Value8(load8v(mine, 48), load8d(mine, 72))


@kernel
def unblocked8(world: Table, here: Surface8, start: Vec3x8, time: F64x8, lamp: LightSample8, asked: Mask8) -> Mask8:
    """Which lights arrive by shadow rays from `start`; see `terminator.shadow_ray`."""
    words = scratch(72)
    step = start - here.p
    moved = (dot8(step, step) > 0.0) & (lamp.distance < math.inf)
    way = lamp.direction * select8d(moved, lamp.distance, splat8d(1.0)) - step
    size = sqrt8d(dot8(way, way))
    store8v(words, 0, start)
    store8v(words, 24, select8v(moved, way * (1.0 / size), lamp.direction))
    store8d(words, 48, here.t_min)
    store8d(words, 56, select8d(moved, size, lamp.distance) - here.t_min)
    store8d(words, 64, time)
    bits, found = movemask8(asked), 0
    while bits != 0:
        k = lowest_bit(bits)
        bits &= bits - 1
        o = lane_at(words, k)
        o = Vec3(o.x, o.y, o.z, f64_at(words, 64 + k))
        if not is_blocked(world, o, lane_at(words, 24 + k), f64_at(words, 48 + k), f64_at(words, 56 + k)):
            found |= 1 << k
    return mask8(found)
