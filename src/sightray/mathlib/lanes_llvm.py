"""Float lanes as the machine sees them: vectors of floats and of bits. The lowering of mathlib/lanes.py for Numba."""

from __future__ import annotations

import operator
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import lower_builtin, models, register_model

from sightray._jit import lower
from sightray.mathlib import lanes
from sightray.mathlib.table_llvm import element
from sightray.mathlib.vec_llvm import llvm_function

F32, F64, I1, I32, I64 = ir.FloatType(), ir.DoubleType(), ir.IntType(1), ir.IntType(32), ir.IntType(64)
FLAGS = ("contract", "nsz")
HOST = llvm.get_host_cpu_features()


class LanesType(types.Type):
    """Numba's name for a number of lanes of 32 or 64 bits."""

    def __init__(self, width: int, bits: int = 32):
        self.width, self.bits = width, bits
        super().__init__(f"F{bits}x{width}")


class MaskType(types.Type):
    """Numba's name for a number of truth values."""

    def __init__(self, width: int):
        self.width = width
        super().__init__(f"Mask{width}")


class IntegersType(types.Type):
    """Numba's name for a number of integers of 64 bits."""

    def __init__(self, width: int):
        self.width = width
        super().__init__(f"I64x{width}")


@register_model(IntegersType)
class IntegersModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any):
        super().__init__(manager, kind, ir.VectorType(I64, kind.width))


@register_model(LanesType)
class LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any):
        super().__init__(manager, kind, ir.VectorType(F32 if kind.bits == 32 else F64, kind.width))


@register_model(MaskType)
class MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any):
        super().__init__(manager, kind, ir.VectorType(I1, kind.width))


TYPES = {
    lanes.F32x4: LanesType(4), lanes.F32x8: LanesType(8), lanes.F32x16: LanesType(16), lanes.F64x16: LanesType(16, 64),
    lanes.I64x8: IntegersType(8), lanes.Mask4: MaskType(4), lanes.Mask8: MaskType(8), lanes.Mask16: MaskType(16),
}  # fmt: skip


def _operator(symbol: Any, operand: Any, compares: bool, emit: Any) -> None:
    """Register an operator between two values of the same kind and width."""

    @infer_global(symbol)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) != 2 or not isinstance(args[0], operand) or args[0] != args[1]:
                return None
            return (MaskType(args[0].width) if compares else args[0])(*args)

    lower_builtin(symbol, operand, operand)(lambda context, builder, sig, args: emit(builder, *args))


def _arithmetic(instruction: str) -> Any:
    return lambda builder, a, b: getattr(builder, instruction)(a, b, flags=FLAGS)


def _comparison(sign: str) -> Any:
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


for _symbol, _instruction in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"),
                              (operator.truediv, "fdiv")):  # fmt: skip
    _operator(_symbol, LanesType, False, _arithmetic(_instruction))
for _symbol, _sign in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _operator(_symbol, LanesType, True, _comparison(_sign))
_operator(operator.and_, MaskType, False, lambda builder, a, b: builder.and_(a, b))
_operator(operator.or_, MaskType, False, lambda builder, a, b: builder.or_(a, b))


def _select(sign: str) -> Any:
    """Minimum and maximum as compare and select, which the processor has as one instruction."""
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, a, b), a, b)


def _lower_width(width: int, scalar: Any, suffix: str, names: str) -> None:
    """The primitives that exist in several widths: those among `names`."""
    kind = ir.VectorType(scalar, width)
    integer, size = (I32, 4) if scalar is F32 else (I64, 8)
    integers = ir.VectorType(integer, width)
    top = ir.Constant(integers, [-(1 << (8 * size - 1))] * width)
    anything = ir.Constant(kind, ir.Undefined)
    first = ir.Constant(ir.VectorType(I32, width), [0] * width)
    kinds = f"v{width}f{8 * size}"

    def splat(builder: Any, value: Any) -> Any:
        value = builder.fptrunc(value, F32) if scalar is F32 else value
        single = builder.insert_element(anything, value, I32(0))
        return builder.shuffle_vector(single, anything, first)

    def load(builder: Any, table: Any, index: Any) -> Any:
        return builder.load(element(builder, table, index, kind, size), align=size)

    def store(builder: Any, table: Any, index: Any, a: Any) -> None:
        builder.store(a, element(builder, table, index, kind, size), align=size)

    def movemask(builder: Any, mask: Any) -> Any:
        return builder.zext(builder.bitcast(mask, ir.IntType(width)), I64)

    def flip(builder: Any, a: Any, sign: Any) -> Any:
        bits = builder.and_(builder.bitcast(sign, integers), top)
        return builder.bitcast(builder.xor(builder.bitcast(a, integers), bits), kind)

    def absolute(builder: Any, a: Any) -> Any:
        return llvm_function(builder, f"llvm.fabs.{kinds}", kind, a)

    def least(builder: Any, a: Any) -> Any:
        function = ir.FunctionType(scalar, [kind])
        name = f"llvm.vector.reduce.fmin.{kinds}"
        reduce = builder.module.globals.get(name) or ir.Function(builder.module, function, name)
        found = builder.call(reduce, [a], fastmath=("nnan",))
        return builder.fpext(found, F64) if scalar is F32 else found

    every: dict[str, Any] = {
        "splat": splat, "load": load, "store": store, "movemask": movemask, "vmin": _select("<"), "vmax": _select(">"),
        "flip": flip, "abs": absolute, "least": least, "select": lambda builder, c, a, b: builder.select(c, a, b),
        "product": lambda builder, a, b: builder.fmul(a, b),
        "sqrt": lambda builder, a: llvm_function(builder, f"llvm.sqrt.{kinds}", kind, a),
    }  # fmt: skip
    for name in names.split():
        lower(getattr(lanes, f"{name}{width}{suffix}"))(every[name])


_lower_width(4, F32, "", "splat load store movemask vmin vmax flip")
_lower_width(8, F32, "", "splat load store movemask vmin vmax select sqrt")
_lower_width(16, F32, "", "splat load store movemask vmin vmax flip least select")
_lower_width(16, F64, "d", "splat load store vmin vmax abs select product sqrt")


def _half(first: int) -> Any:
    """Four of eight lanes."""
    chosen = ir.Constant(ir.VectorType(I32, 4), [first, first + 1, first + 2, first + 3])
    return lambda builder, a: builder.shuffle_vector(a, a, chosen)


@lower(lanes.repeat4)
def repeat4(builder: Any, a: Any) -> Any:
    return builder.shuffle_vector(a, a, ir.Constant(ir.VectorType(I32, 16), [0, 1, 2, 3] * 4))


lower(lanes.low4)(_half(0))
lower(lanes.high4)(_half(4))


@lower(lanes.mask16)
def mask16(builder: Any, bits: Any) -> Any:
    return builder.bitcast(builder.trunc(bits, ir.IntType(16)), ir.VectorType(I1, 16))


@lower(lanes.round16)
def round16(builder: Any, a: Any) -> Any:
    return builder.fptrunc(a, ir.VectorType(F32, 16))


@lower(lanes.widen16)
def widen16(builder: Any, a: Any) -> Any:
    return builder.fpext(a, ir.VectorType(F64, 16))


@lower(lanes.extract4)
def extract4(builder: Any, a: Any, lane: Any) -> Any:
    return builder.fpext(builder.extract_element(a, lane), F64)


@lower(lanes.lowest_bit)
def lowest_bit(builder: Any, bits: Any) -> Any:
    return llvm_function(builder, "llvm.cttz.i64", I64, bits, I1(1))


@lower(lanes.sort_key)
def sort_key(builder: Any, distance: Any) -> Any:
    bits = builder.bitcast(builder.fptrunc(distance, F32), I32)
    return builder.shl(builder.sext(bits, I64), I64(32))


def _shuffle(builder: Any, a: Any, b: Any, chosen: list[int]) -> Any:
    """Lanes of two vectors by their numbers."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(I32, len(chosen)), chosen))


def _call(builder: Any, name: str, result: Any, *values: Any) -> Any:
    """Call an intrinsic whose arguments are of several types."""
    kind = ir.FunctionType(result, [value.type for value in values])
    return builder.call(builder.module.globals.get(name) or ir.Function(builder.module, kind, name), values)


def _compressed(builder: Any, values: Any, bits: Any, name: str) -> Any:
    """The lanes whose bits are set, moved to the front."""
    chosen = builder.bitcast(builder.trunc(bits, ir.IntType(8)), ir.VectorType(I1, 8))
    name = f"llvm.experimental.vector.compress.{name}"
    return _call(builder, name, values.type, values, chosen, ir.Constant(values.type, ir.Undefined))


@lower(lanes.count_bits)
def count_bits(builder: Any, bits: Any) -> Any:
    return _call(builder, "llvm.ctpop.i64", I64, bits)


@lower(lanes.highest_bit)
def highest_bit(builder: Any, bits: Any) -> Any:
    return builder.sub(I64(63), _call(builder, "llvm.ctlz.i64", I64, bits, I1(1)))


@lower(lanes.push8)
def push8(builder: Any, stack: Any, top: Any, codes: Any, bits: Any) -> None:
    codes = _compressed(builder, builder.bitcast(codes, ir.VectorType(I32, 8)), bits, "v8i32")
    words = builder.zext(codes, ir.VectorType(I64, 8))
    builder.store(words, element(builder, stack, top, words.type, 8), align=8)


def _permuted(builder: Any, values: Any, lanes_of: Any) -> Any:
    """Eight lanes by numbers that only the running program knows."""
    if HOST.get("avx2"):
        return _call(builder, "llvm.x86.avx2.permd", values.type, values, lanes_of)
    result = ir.Constant(values.type, ir.Undefined)
    for lane in range(8):
        value = builder.extract_element(values, builder.extract_element(lanes_of, I32(lane)))
        result = builder.insert_element(result, value, I32(lane))
    return result


@lower(lanes.sort8)
def sort8(builder: Any, lengths: Any, codes: Any, chosen: Any) -> Any:
    narrow, wide = ir.VectorType(I32, 8), ir.VectorType(I64, 8)
    seven = ir.Constant(narrow, [7] * 8)
    lengths = builder.or_(builder.bitcast(lengths, narrow), seven)
    keys = builder.select(chosen, lengths, ir.Constant(narrow, [-1] * 8))
    keys = builder.xor(keys, ir.Constant(narrow, [7 - lane for lane in range(8)]))

    # A sorting network has no branches (K. Batcher, "Sorting networks and their applications", 1968).
    for block in (2, 4, 8):
        step = block // 2
        while step > 0:
            other = _shuffle(builder, keys, keys, [lane ^ step for lane in range(8)])
            low = _call(builder, "llvm.smin.v8i32", narrow, keys, other)
            high = _call(builder, "llvm.smax.v8i32", narrow, keys, other)
            keys_of = [lane if (lane & step == 0) == (lane & block == 0) else 8 + lane for lane in range(8)]
            keys = _shuffle(builder, high, low, keys_of)
            step //= 2

    # The three lowest bits say from which lane a length came.
    lanes_of = builder.and_(keys, seven)
    sorted_codes = _permuted(builder, builder.bitcast(codes, narrow), lanes_of)
    keys = builder.xor(keys, lanes_of)
    zipped = [lane // 2 + 8 * (lane % 2) for lane in range(16)]
    return builder.bitcast(_shuffle(builder, sorted_codes, keys, zipped), wide)


@lower(lanes.push_all8)
def push_all8(builder: Any, stack: Any, top: Any, keys: Any) -> None:
    builder.store(keys, element(builder, stack, top, keys.type, 8), align=8)


def _transpose(scalar: Any, size: int) -> Any:
    """Three rows of sixteen out of sixteen rows of three."""
    kind, wide = ir.VectorType(scalar, 48), ir.VectorType(F64, 16)

    def emit(builder: Any, rows: Any, index: Any, target: Any, word: Any) -> None:
        values = builder.load(element(builder, rows, index, kind, size), align=size)
        for axis in range(3):
            chosen = ir.Constant(ir.VectorType(I32, 16), [3 * lane + axis for lane in range(16)])
            column = builder.shuffle_vector(values, values, chosen)
            column = builder.fpext(column, wide) if scalar is F32 else column
            builder.store(column, element(builder, target, builder.add(word, I64(16 * axis)), wide, 8), align=8)

    return emit


lower(lanes.transpose16)(_transpose(F32, 4))
lower(lanes.transpose16d)(_transpose(F64, 8))


@lower(lanes.prefetch)
def prefetch(builder: Any, table: Any, index: Any) -> None:
    place = builder.bitcast(element(builder, table, index, F32, 4), ir.IntType(8).as_pointer())
    kind = ir.FunctionType(ir.VoidType(), [place.type, I32, I32, I32])
    name = "llvm.prefetch.p0"
    function = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
    builder.call(function, [place, I32(0), I32(3), I32(1)])  # to read, into all caches, data


@lower(lanes.put_ints16)
def put_ints16(builder: Any, table: Any, index: Any, a: Any) -> None:
    kind = ir.VectorType(I32, 16)
    builder.store(builder.fptosi(a, kind), element(builder, table, index, kind, 4), align=4)


@lower(lanes.put_bytes16)
def put_bytes16(builder: Any, table: Any, word: Any, mask: Any) -> None:
    kind = ir.VectorType(ir.IntType(8), 16)
    builder.store(builder.zext(mask, kind), element(builder, table, word, kind, 8), align=1)
