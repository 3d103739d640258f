"""The lowering of mathlib/eights.py: vectors of eight doubles and integers, and three of the former."""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_getattr, infer_global
from numba.extending import lower_builtin, lower_getattr, models, register_model

from sightray._jit import lower
from sightray.mathlib import eights, rng_llvm
from sightray.mathlib.lanes_llvm import F32, F64, FLAGS, I1, I32, I64, IntegersType, LanesType, MaskType, _compressed
from sightray.mathlib.table_llvm import element
from sightray.mathlib.vec_llvm import lane, llvm_function

DOUBLES, INTEGERS, MASK = ir.VectorType(F64, 8), ir.VectorType(I64, 8), ir.VectorType(I1, 8)
F64X8, I64X8, MASK8 = LanesType(8, 64), IntegersType(8), MaskType(8)
VECTORS = ir.LiteralStructType([DOUBLES] * 3)


class VectorsType(types.Type):
    """Numba's name for `Vec3x8`."""

    def __init__(self) -> None:
        super().__init__("Vec3x8")


VEC3X8 = VectorsType()
TYPES = {eights.F64x8: F64X8, eights.I64x8: I64X8, eights.Vec3x8: VEC3X8}


@register_model(VectorsType)
class VectorsModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any):
        super().__init__(manager, kind, VECTORS)


def _splat(builder: Any, value: Any) -> Any:
    kind = ir.VectorType(value.type, 8)
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), value, I32(0))
    return builder.shuffle_vector(first, first, ir.Constant(ir.VectorType(I32, 8), [0] * 8))


def _parts(builder: Any, a: Any) -> list[Any]:
    return [builder.extract_value(a, axis) for axis in range(3)]


def _vector(builder: Any, parts: Any) -> Any:
    value = ir.Constant(VECTORS, ir.Undefined)
    for axis, part in enumerate(parts):
        value = builder.insert_value(value, part, axis)
    return value


def _register(symbol: Any, kind: Any, scalar: Any, result: Any, emit: Any) -> None:
    """An operator of lanes and lanes, lanes and number, number and lanes."""

    @infer_global(symbol)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) != 2 or kind not in args:
                return None
            if all(a == kind or isinstance(a, types.Number) for a in args):
                return result(*[a if a == kind else scalar for a in args])
            return None

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit(builder, *(v if k == kind else _splat(builder, v) for v, k in zip(args, sig.args, strict=True)))

    for kinds in ((kind, scalar), (scalar, kind)):
        lower_builtin(symbol, *kinds)(lowered)
    if (kind, symbol) not in _KNOWN:
        lower_builtin(symbol, kind, kind)(lowered)


_COMPARISONS = ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">="))
_ARITHMETIC = ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv"))
_INTEGER = ((operator.add, "add"), (operator.sub, "sub"), (operator.mul, "mul"), (operator.xor, "xor"),
            (operator.ixor, "xor"), (operator.and_, "and_"), (operator.or_, "or_"), (operator.rshift, "ashr"),
            (operator.lshift, "shl"))  # fmt: skip
_KNOWN = {(F64X8, symbol) for symbol, _ in (*_COMPARISONS, *_ARITHMETIC)}  # by lanes_llvm, for lanes and lanes


def _float(instruction: str) -> Any:
    return lambda builder, a, b: getattr(builder, instruction)(a, b, flags=FLAGS)


def _compare(sign: str, doubles: bool) -> Any:
    return lambda builder, a, b: (builder.fcmp_ordered if doubles else builder.icmp_signed)(sign, a, b)


def _whole(instruction: str) -> Any:
    return lambda builder, a, b: getattr(builder, instruction)(a, b)


for _symbol, _instruction in _ARITHMETIC:
    _register(_symbol, F64X8, types.float64, F64X8, _float(_instruction))
for _symbol, _sign in _COMPARISONS:
    _register(_symbol, F64X8, types.float64, MASK8, _compare(_sign, True))
for _symbol, _sign in (*_COMPARISONS, (operator.eq, "=="), (operator.ne, "!=")):
    _register(_symbol, I64X8, types.int64, MASK8, _compare(_sign, False))
for _symbol, _instruction in _INTEGER:
    _register(_symbol, I64X8, types.int64, I64X8, _whole(_instruction))


def _of_vectors(symbol: Any, instruction: str, *others: Any) -> None:
    """An operator of vectors, and of vectors and lanes or a number."""

    @infer_global(symbol)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) != 2 or args[0] != VEC3X8:
                return None
            if args[1] in (VEC3X8, *others):
                return VEC3X8(*args)
            return VEC3X8(VEC3X8, types.float64) if others and isinstance(args[1], types.Number) else None

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        a, b = args
        factors = _parts(builder, b) if sig.args[1] == VEC3X8 else [b if sig.args[1] == F64X8 else _splat(builder, b)] * 3
        pairs = zip(_parts(builder, a), factors, strict=True)
        return _vector(builder, [getattr(builder, instruction)(p, q, flags=FLAGS) for p, q in pairs])

    for other in (VEC3X8, *others):
        lower_builtin(symbol, VEC3X8, other)(lowered)


_of_vectors(operator.add, "fadd")
_of_vectors(operator.sub, "fsub")
_of_vectors(operator.mul, "fmul", F64X8, types.float64)


@infer_global(operator.neg)
class Negation(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return args[0](args[0]) if len(args) == 1 and args[0] in (F64X8, VEC3X8) else None


@lower_builtin(operator.neg, F64X8)
def negate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


@lower_builtin(operator.neg, VEC3X8)
def negate_vectors(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _vector(builder, [builder.fneg(part) for part in _parts(builder, args[0])])


@infer_global(eights.Vec3x8)
class Construction(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return VEC3X8(F64X8, F64X8, F64X8) if len(args) == 3 else None


@lower_builtin(eights.Vec3x8, F64X8, F64X8, F64X8)
def construct(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _vector(builder, args)


@infer_getattr
class Components(AttributeTemplate):
    key = VectorsType

    def generic_resolve(self, kind: Any, name: str) -> Any:  # type: ignore[override]
        return F64X8 if name in ("x", "y", "z") else None


def _component(name: str, index: int) -> None:
    @lower_getattr(VectorsType, name)
    def get(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        return builder.extract_value(value, index)


for _index, _name in enumerate("xyz"):
    _component(_name, _index)


def _memory(suffix: str, kind: Any, scalar: Any) -> None:
    """Loads, stores, gathers, choices and copies of one kind of lanes."""

    def load(builder: Any, table: Any, index: Any) -> Any:
        return builder.load(element(builder, table, index, kind, 8), align=8)

    def store(builder: Any, table: Any, index: Any, a: Any) -> None:
        builder.store(a, element(builder, table, index, kind, 8), align=8)

    def gather(builder: Any, table: Any, index: Any) -> Any:
        value = ir.Constant(kind, ir.Undefined)
        for k in range(8):
            at = element(builder, table, builder.extract_element(index, I32(k)), scalar, 8)
            value = builder.insert_element(value, builder.load(at, align=8), I32(k))
        return value

    def store_chosen(builder: Any, table: Any, index: Any, a: Any, chosen: Any) -> None:
        bits = builder.zext(builder.bitcast(chosen, ir.IntType(8)), I64)
        name = "v8f64" if scalar is F64 else "v8i64"
        store(builder, table, index, _compressed(builder, a, bits, name))

    lower(getattr(eights, f"splat8{suffix}"))(_splat)
    lower(getattr(eights, f"load8{suffix}"))(load)
    lower(getattr(eights, f"store8{suffix}"))(store)
    lower(getattr(eights, f"gather8{suffix}"))(gather)
    lower(getattr(eights, f"store_chosen8{suffix}"))(store_chosen)
    lower(getattr(eights, f"select8{suffix}"))(lambda builder, c, a, b: builder.select(c, a, b))


_memory("d", DOUBLES, F64)
_memory("i", INTEGERS, I64)


@lower(eights.gather8f)
def gather8f(builder: Any, table: Any, index: Any) -> Any:
    value = ir.Constant(ir.VectorType(F32, 8), ir.Undefined)
    for k in range(8):
        at = element(builder, table, builder.extract_element(index, I32(k)), F32, 4)
        value = builder.insert_element(value, builder.load(at, align=4), I32(k))
    return builder.fpext(value, DOUBLES)


@lower(eights.splat8v)
def splat8v(builder: Any, value: Any) -> Any:
    return _vector(builder, [_splat(builder, lane(builder, value, axis)) for axis in range(3)])


@lower(eights.select8v)
def select8v(builder: Any, choice: Any, a: Any, b: Any) -> Any:
    pairs = zip(_parts(builder, a), _parts(builder, b), strict=True)
    return _vector(builder, [builder.select(choice, p, q) for p, q in pairs])


@lower(eights.not8)
def not8(builder: Any, choice: Any) -> Any:
    return builder.not_(choice)


@lower(eights.mask8)
def mask8(builder: Any, bits: Any) -> Any:
    return builder.bitcast(builder.trunc(bits, ir.IntType(8)), MASK)


def _smaller(sign: str) -> Any:
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, a, b), a, b)


lower(eights.vmin8d)(_smaller("<"))
lower(eights.vmax8d)(_smaller(">"))


@lower(eights.abs8d)
def abs8d(builder: Any, a: Any) -> Any:
    return llvm_function(builder, "llvm.fabs.v8f64", DOUBLES, a)


@lower(eights.sqrt8d)
def sqrt8d(builder: Any, a: Any) -> Any:
    return llvm_function(builder, "llvm.sqrt.v8f64", DOUBLES, a)


@lower(eights.bits8d)
def bits8d(builder: Any, a: Any) -> Any:
    return builder.bitcast(a, INTEGERS)


@lower(eights.of_bits8d)
def of_bits8d(builder: Any, a: Any) -> Any:
    return builder.bitcast(a, DOUBLES)


@lower(eights.sign8d)
def sign8d(builder: Any, a: Any) -> Any:
    one = ir.Constant(DOUBLES, [1.0] * 8)
    return llvm_function(builder, "llvm.copysign.v8f64", DOUBLES, one, a)


@lower(eights.whole8d)
def whole8d(builder: Any, a: Any) -> Any:
    return builder.sitofp(a, DOUBLES)


@lower(eights.floor8d)
def floor8d(builder: Any, a: Any) -> Any:
    return llvm_function(builder, "llvm.floor.v8f64", DOUBLES, a)


@lower(eights.floor8i)
def floor8i(builder: Any, a: Any) -> Any:
    return builder.fptosi(a, INTEGERS)


@lower(eights.whole8i)
def whole8i(builder: Any, a: Any) -> Any:
    return builder.fptosi(a, INTEGERS)


@lower(eights.round8d)
def round8d(builder: Any, a: Any) -> Any:
    return builder.fptrunc(a, ir.VectorType(F32, 8))


@lower(eights.dot8)
def dot8(builder: Any, a: Any, b: Any) -> Any:
    x, y, z = (builder.fmul(p, q, flags=FLAGS) for p, q in zip(_parts(builder, a), _parts(builder, b), strict=True))
    return builder.fadd(builder.fadd(x, y, flags=FLAGS), z, flags=FLAGS)


@lower(eights.cross8)
def cross8(builder: Any, a: Any, b: Any) -> Any:
    p, q = _parts(builder, a), _parts(builder, b)
    parts = []
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        left, right = builder.fmul(p[one], q[two], flags=FLAGS), builder.fmul(p[two], q[one], flags=FLAGS)
        parts.append(builder.fsub(left, right, flags=FLAGS))
    return _vector(builder, parts)


@lower(eights.reverse8)
def reverse8(builder: Any, x: Any) -> Any:
    return llvm_function(builder, "llvm.bitreverse.v8i64", INTEGERS, x)


lower(eights.stream8)(rng_llvm.stream)
lower(eights.word8)(rng_llvm.word)
