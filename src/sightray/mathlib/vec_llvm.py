"""`Vec3` as the machine sees it: one vector of four doubles. The lowering of mathlib/vec.py for Numba."""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_getattr, infer_global
from numba.extending import lower_builtin, lower_getattr, models, register_model

from sightray._jit import lower
from sightray.mathlib import vec

F64, I32 = ir.DoubleType(), ir.IntType(32)
LANES = ir.VectorType(F64, 4)
FLAGS = ("contract", "nsz")


class Vec3Type(types.Type):
    """Numba's name for `Vec3`."""

    def __init__(self) -> None:
        super().__init__("Vec3")


VEC3 = Vec3Type()
TYPES = {vec.Vec3: VEC3}


@register_model(Vec3Type)
class Vec3Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any):
        super().__init__(manager, kind, LANES)


def shuffle(builder: Any, value: Any, lanes: list[int]) -> Any:
    """Lanes of `value` in another order."""
    return builder.shuffle_vector(value, value, ir.Constant(ir.VectorType(I32, 4), lanes))


def splat(builder: Any, value: Any) -> Any:
    """One scalar in all four lanes."""
    first = builder.insert_element(ir.Constant(LANES, ir.Undefined), value, I32(0))
    return shuffle(builder, first, [0, 0, 0, 0])


def lane(builder: Any, value: Any, index: int) -> Any:
    """One lane as a scalar."""
    return builder.extract_element(value, I32(index))


def _arithmetic(symbol: Any, instruction: str) -> None:
    """Register an operator for vector and vector, vector and number, number and vector."""

    @infer_global(symbol)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) == 2 and VEC3 in args:
                kinds = [a if a == VEC3 else types.float64 for a in args if a == VEC3 or isinstance(a, types.Number)]
                return VEC3(*kinds) if len(kinds) == 2 else None
            return None

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        a, b = (v if kind == VEC3 else splat(builder, v) for v, kind in zip(args, sig.args, strict=True))
        return getattr(builder, instruction)(a, b, flags=FLAGS)

    for kinds in ((VEC3, VEC3), (VEC3, types.float64), (types.float64, VEC3)):
        lower_builtin(symbol, *kinds)(emit)


for _symbols, _instruction in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
    ((operator.truediv, operator.itruediv), "fdiv"),
):
    for _symbol in _symbols:
        _arithmetic(_symbol, _instruction)


@infer_global(operator.neg)
class Negation(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return VEC3(VEC3) if args == (VEC3,) else None


@lower_builtin(operator.neg, VEC3)
def negate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


@infer_global(vec.Vec3)
class Construction(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return VEC3(*[types.float64] * len(args)) if len(args) in (3, 4) else None


def construct(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    value = ir.Constant(LANES, [0.0] * 4)
    for index, part in enumerate(args):
        value = builder.insert_element(value, part, I32(index))
    return value


lower_builtin(vec.Vec3, *[types.float64] * 3)(construct)
lower_builtin(vec.Vec3, *[types.float64] * 4)(construct)


@infer_getattr
class Components(AttributeTemplate):
    key = Vec3Type

    def generic_resolve(self, kind: Any, name: str) -> Any:  # type: ignore[override]
        return types.float64 if name in ("x", "y", "z", "w") else None


def _component(name: str, index: int) -> None:
    @lower_getattr(Vec3Type, name)
    def get(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        return lane(builder, value, index)


for _index, _name in enumerate("xyzw"):
    _component(_name, _index)


def llvm_function(builder: Any, name: str, result: Any, *arguments: Any) -> Any:
    """Call an LLVM intrinsic by its full name."""
    kind = ir.FunctionType(result, [a.type for a in arguments])
    function = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
    return builder.call(function, arguments)


lower(vec.grey)(splat)


@lower(vec.dot)
def dot(builder: Any, a: Any, b: Any) -> Any:
    p = builder.fmul(a, b, flags=FLAGS)
    xy = builder.fadd(lane(builder, p, 0), lane(builder, p, 1), flags=FLAGS)
    return builder.fadd(xy, lane(builder, p, 2), flags=FLAGS)


def _cross(flags: tuple[str, ...]) -> Any:
    def emit(builder: Any, a: Any, b: Any) -> Any:
        turn = [1, 2, 0, 3]
        left = builder.fmul(a, shuffle(builder, b, turn), flags=flags)
        right = builder.fmul(shuffle(builder, a, turn), b, flags=flags)
        return shuffle(builder, builder.fsub(left, right, flags=flags), turn)

    return emit


lower(vec.cross)(_cross(FLAGS))
lower(vec.rounded_cross)(_cross(()))


@lower(vec.rounded_product)
def rounded_product(builder: Any, a: Any, factor: Any) -> Any:
    return builder.fmul(a, splat(builder, factor))


@lower(vec.length)
def length(builder: Any, a: Any) -> Any:
    return llvm_function(builder, "llvm.sqrt.f64", F64, dot(builder, a, a))


@lower(vec.normalize)
def normalize(builder: Any, a: Any) -> Any:
    return builder.fdiv(a, splat(builder, length(builder, a)))


def _select(comparison: str) -> Any:
    def emit(builder: Any, a: Any, b: Any) -> Any:
        return builder.select(builder.fcmp_ordered(comparison, a, b), a, b)

    return emit


lower(vec.vmin)(_select("<"))
lower(vec.vmax)(_select(">"))


@lower(vec.vabs)
def vabs(builder: Any, a: Any) -> Any:
    return llvm_function(builder, "llvm.fabs.v4f64", LANES, a)


@lower(vec.max3)
def max3(builder: Any, a: Any) -> Any:
    larger = _select(">")
    return larger(builder, larger(builder, lane(builder, a, 0), lane(builder, a, 1)), lane(builder, a, 2))


@lower(vec.max4)
def max4(builder: Any, a: Any) -> Any:
    larger = _select(">")
    return larger(builder, max3(builder, a), lane(builder, a, 3))


@lower(vec.mean4)
def mean4(builder: Any, a: Any) -> Any:
    xy = builder.fadd(lane(builder, a, 0), lane(builder, a, 1))
    total = builder.fadd(xy, builder.fadd(lane(builder, a, 2), lane(builder, a, 3)))
    return builder.fmul(total, ir.Constant(F64, 0.25))


@lower(vec.vexp)
def vexp(builder: Any, a: Any) -> Any:
    for index in range(4):
        part = llvm_function(builder, "llvm.exp.f64", F64, lane(builder, a, index))
        a = builder.insert_element(a, part, I32(index))
    return a
