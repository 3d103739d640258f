"""Walking a bounding volume hierarchy whose nodes have eight children: one instruction tests eight boxes.

A **node** is 256 bytes, four cache lines. As floats: lower x of the eight children (0-7), upper x (8-15), lower and
upper y (16-31), lower and upper z (32-47). Then eight 32-bit integers (48-55) that say what each child is:

- a number below `LEAF`: the node of that number (never 0, which is the root);
- `LEAF` + 8 * first + count: a leaf, that is items `first` to ``first + count - 1`` of the tree's order.

A child that does not exist has an empty box, from +inf to -inf, which no ray meets. Words 56-63 are spare.

The **unit frame**. A tree lives where its centre is the origin and its largest half extent lies in (1/2, 1], a power of
two away from the true scale. Rays are brought there in double precision and start where they enter the tree's box, so
single precision sees coordinates of at most 1 and path lengths of at most 2, however far away a ray begins.

**Why no hit is lost.** Let u = 2^-24. In single precision an axis' slab distance (b - o) / d carries, as an error of
position: u of the box (|b| <= 1), u of the product o/d, and at most 2u each (|b - o| <= 2) of d's reciprocal and of the last
rounding; sorted out on both ends below 8u. Double precision adds 2^-50 of the distance |o| to the origin. So each ray is
given a `slack` of 16u + 2^-49 |o| to all sides: boxes that it meets so thickened contain all that it meets in truth.

References: I. Wald, C. Benthin, S. Boulos, "Getting Rid of Packets" (RT 2008); T. Ize, "Robust BVH Ray Traversal" (JCGT
2013). The nearest child is visited first, and what is farther than the best hit is dropped when its turn comes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sightray._jit import METHOD_SLOTS, kernel
from sightray.mathlib.lanes import (
    F32x8,
    Mask8,
    count_bits,
    highest_bit,
    load8,
    lowest_bit,
    movemask8,
    push8,
    push_all8,
    sort8,
    sort_key,
    splat8,
    store8,
    vmax8,
    vmin8,
)
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import Table, f32_at, f64_at, i32_at, i64_at, i64_put, scratch, vec3_at
from sightray.mathlib.tally import NODES as VISITS
from sightray.mathlib.tally import tally
from sightray.mathlib.vec import Vec3, grey, max3, vabs, vmax, vmin

NODE_FLOATS, CHILDREN = 64, 48
LEAF = 1 << 30  # the bit that tells leaves from nodes
CHILD = (1 << 32) - 1  # the half of a sort key that names the child
STACK_WORDS = 192  # that a ray's stack has; see `collapse`, which makes no tree that needs more

BOTTOM = -(1 << 63)  # above no key, were it of a negative length; names the root, which is no child: the end of a stack

# The head of a row that has a tree.
NODES = METHOD_SLOTS  # pointer to the nodes
SCALE = METHOD_SLOTS + 1  # unit frame = (world - center) * scale
CENTER = METHOD_SLOTS + 2  # three numbers and one more
HALF = METHOD_SLOTS + 6  # half extents of the tree's box in the unit frame: three numbers and one more
TREE_WORDS = METHOD_SLOTS + 10


class UnitRay(NamedTuple):
    """A ray in a tree's unit frame, from where it enters the box to where it leaves it."""

    o: Vec3  # where it enters the tree's box
    d: Vec3  # direction; its largest component is +-1, so lengths along it are close to true ones
    r: Vec3  # 1/d, but large and finite at zero
    start: f64  # length from the ray's own origin to `o`
    reach: f64  # length from `o` to where the box or the ray ends; negative or NaN if the ray misses the box
    speed: f64  # length per t: length = t * speed - start
    slack: f64  # bound of all rounding errors of position


class BoxRay(NamedTuple):
    """What meets the boxes, eight copies each: x * rx - nx is the length to a near plane x, x * rx - fx to a far one."""

    rx: F32x8
    ry: F32x8
    rz: F32x8
    nx: F32x8
    ny: F32x8
    nz: F32x8
    fx: F32x8
    fy: F32x8
    fz: F32x8
    x: i64  # where a node has the near planes: the lower ones if the ray goes up that axis
    y: i64
    z: i64


@kernel
def int_at(table: Table, index: i64) -> i64:
    """32-bit integer number `index` of a table, as one of 64 bits."""
    return int(i32_at(table, index))


@kernel
def float_at(table: Table, index: i64) -> f64:
    """Float number `index` of a table as a double."""
    return float(f32_at(table, index))


@kernel
def unit_ray(tree: Table, o: Vec3, d: Vec3, t_min: f64, t_max: f64) -> UnitRay:
    """Bring a ray into the tree's unit frame and cut it to the tree's box."""
    scale = f64_at(tree, SCALE)
    o = (o - vec3_at(tree, CENTER)) * scale
    d = d * scale
    speed = max3(vabs(d))
    r = vmax(vmin(1.0 / d, grey(1e200)), grey(-1e200))  # no infinity shall meet a zero
    slack = min(2.0**-20 + 2.0**-49 * max3(vabs(o)), 0.01)
    half = vec3_at(tree, HALF) + (slack + 2.0**-10)  # so that hits on the box's faces lie well inside
    low, high = (-half - o) * r, (half - o) * r
    first = max(max3(vmin(low, high)), t_min)
    last = min(-max3(-vmax(low, high)), t_max)
    if not (1e-100 < speed < 1e100 and t_min < t_max):  # zero, infinite, NaN
        last = -math.inf
    unit = -max3(-vabs(r))  # 1 / speed
    r = vmax(vmin(r * speed, grey(1e18)), grey(-1e18))
    return UnitRay(o + d * first, d * unit, r, first * speed, (last - first) * speed, speed, slack)


@kernel
def box_ray(ray: UnitRay) -> BoxRay:
    """Prepare a ray for the boxes."""
    r, o = ray.r, ray.o * ray.r
    near, far = o + vabs(r) * ray.slack, o - vabs(r) * ray.slack
    return BoxRay(
        splat8(r.x), splat8(r.y), splat8(r.z),
        splat8(near.x), splat8(near.y), splat8(near.z), splat8(far.x), splat8(far.y), splat8(far.z),
        0 if r.x > 0.0 else 8, 16 if r.y > 0.0 else 24, 32 if r.z > 0.0 else 40,
    )  # fmt: skip


class Met(NamedTuple):
    """What a ray finds at a node."""

    near: F32x8  # lengths to where it enters the children's boxes
    met: Mask8  # which children it meets


@kernel
def meet_boxes(nodes: Table, node: i64, ray: BoxRay, reach: f64) -> Met:
    """Meet the eight boxes of a node with a ray, within `reach`."""
    tally(VISITS)
    at = node * NODE_FLOATS
    near_x, far_x = load8(nodes, at + ray.x) * ray.rx - ray.nx, load8(nodes, at + 8 - ray.x) * ray.rx - ray.fx
    near_y, far_y = load8(nodes, at + ray.y) * ray.ry - ray.ny, load8(nodes, at + 40 - ray.y) * ray.ry - ray.fy
    near_z, far_z = load8(nodes, at + ray.z) * ray.rz - ray.nz, load8(nodes, at + 72 - ray.z) * ray.rz - ray.fz
    near = vmax8(vmax8(near_x, near_y), vmax8(near_z, splat8(0.0)))
    far = vmin8(vmin8(far_x, far_y), vmin8(far_z, splat8(reach)))
    return Met(near, near <= far)


@kernel
def push_children(nodes: Table, node: i64, ray: BoxRay, reach: f64, stack: Table, top: i64) -> i64:
    """Push keys of the children that the ray meets within `reach`, the nearest last; the stack's new height.

    A ray on its own waits for its next node: branches, which are usually guessed right, take less long than `visit_nearest`.
    """
    found = meet_boxes(nodes, node, ray, reach)
    lengths = scratch(4)
    store8(lengths, 0, found.near)
    bits, base = movemask8(found.met), top
    while bits != 0:
        lane = lowest_bit(bits)
        bits &= bits - 1
        # Lengths are not negative, so their bits sort as they do.
        key = (int_at(lengths, lane) << 32) | int_at(nodes, node * NODE_FLOATS + CHILDREN + lane)
        i = top
        while i > base and i64_at(stack, i - 1) < key:  # insertion sort: usually there are one to three
            i64_put(stack, i, i64_at(stack, i - 1))
            i -= 1
        i64_put(stack, i, key)
        top += 1
    return top


@kernel
def push_children_unsorted(nodes: Table, node: i64, ray: BoxRay, reach: f64, stack: Table, top: i64) -> i64:
    """Push the children that the ray meets within `reach`, in the node's order; the stack's new height."""
    bits = movemask8(meet_boxes(nodes, node, ray, reach).met)
    push8(stack, top, load8(nodes, node * NODE_FLOATS + CHILDREN), bits)
    return top + count_bits(bits)


class Next(NamedTuple):
    """What comes after a node."""

    key: i64  # the child to visit, with its distance as high half; void if none is met
    top: i64  # the stack's height with all the others
    met: bool


@kernel
def visit_nearest(nodes: Table, node: i64, ray: BoxRay, reach: f64, stack: Table, top: i64) -> Next:
    """Push keys of the children that the ray meets within `reach`, the nearest last, and pop what is next."""
    found = meet_boxes(nodes, node, ray, reach)
    push_all8(stack, top, sort8(found.near, load8(nodes, node * NODE_FLOATS + CHILDREN), found.met))
    return pop_near(stack, top + count_bits(movemask8(found.met)), reach)


@kernel
def visit_last(nodes: Table, node: i64, ray: BoxRay, reach: f64, stack: Table, top: i64) -> Next:
    """The last child in the node's order that the ray meets within `reach`; the others are pushed."""
    bits = movemask8(meet_boxes(nodes, node, ray, reach).met)
    last = highest_bit(bits | 1)
    push8(stack, top, load8(nodes, node * NODE_FLOATS + CHILDREN), bits & ~(1 << last))
    child = int_at(nodes, node * NODE_FLOATS + CHILDREN + last)
    return Next(child, top + max(count_bits(bits) - 1, 0), bits != 0)


@kernel
def pop_near(stack: Table, top: i64, reach: f64) -> Next:
    """The highest key on the stack that is not farther than `reach`; what is above is dropped."""
    farthest = sort_key(reach)
    top -= 1
    while i64_at(stack, top) > farthest:
        top -= 1
    return Next(i64_at(stack, top), top, top > 0)
