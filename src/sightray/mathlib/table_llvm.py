"""`Table` as the machine sees it: a pointer; its accessors: one load or store. The lowering of mathlib/table.py."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import lower_builtin, models, register_model

from sightray._jit import lower
from sightray.mathlib import table
from sightray.mathlib.vec_llvm import LANES

I8, I32, I64 = ir.IntType(8), ir.IntType(32), ir.IntType(64)
POINTER = I8.as_pointer()


class TableType(types.Type):
    """Numba's name for `Table`."""

    def __init__(self) -> None:
        super().__init__("Table")


TABLE = TableType()
TYPES = {table.Table: TABLE}


@register_model(TableType)
class TableModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any):
        super().__init__(manager, kind, POINTER)


def element(builder: Any, pointer: Any, index: Any, kind: Any, size: int) -> Any:
    """Pointer to element `index` of `size` bytes, as a pointer to `kind`."""
    at = builder.gep(builder.bitcast(pointer, ir.IntType(8 * size).as_pointer()), [index])
    return builder.bitcast(at, kind.as_pointer())


def _accessors(get: Any, put: Any, kind: Any, size: int) -> None:
    """Lower a load, and a store that rounds to what is stored."""

    @lower(get)
    def load(builder: Any, pointer: Any, index: Any) -> Any:
        return builder.load(element(builder, pointer, index, kind, size), align=size)

    @lower(put)
    def store(builder: Any, pointer: Any, index: Any, value: Any) -> None:
        if value.type != kind:
            value = builder.fptrunc(value, kind) if isinstance(kind, ir.FloatType) else builder.trunc(value, kind)
        builder.store(value, element(builder, pointer, index, kind, size), align=size)


_accessors(table.f64_at, table.f64_put, ir.DoubleType(), 8)
_accessors(table.i64_at, table.i64_put, I64, 8)
_accessors(table.f32_at, table.f32_put, ir.FloatType(), 4)
_accessors(table.i32_at, table.i32_put, I32, 4)


@lower(table.vec3_at)
def vec3_at(builder: Any, pointer: Any, index: Any) -> Any:
    return builder.load(element(builder, pointer, index, LANES, 8), align=8)


@lower(table.vec3_put)
def vec3_put(builder: Any, pointer: Any, index: Any, value: Any) -> None:
    builder.store(value, element(builder, pointer, index, LANES, 8), align=8)


@lower(table.table_at)
def table_at(builder: Any, pointer: Any, index: Any) -> Any:
    return builder.load(element(builder, pointer, index, POINTER, 8), align=8)


@lower(table.table_put)
def table_put(builder: Any, pointer: Any, index: Any, target: Any) -> None:
    builder.store(target, element(builder, pointer, index, POINTER, 8), align=8)


@lower(table.advance)
def advance(builder: Any, pointer: Any, words: Any) -> Any:
    return element(builder, pointer, words, I8, 8)


@lower(table.words_to)
def words_to(builder: Any, pointer: Any, address: Any) -> Any:
    return builder.ashr(builder.sub(address, builder.ptrtoint(pointer, I64)), I64(3))


@lower(table.no_table)
def no_table(builder: Any) -> Any:
    return ir.Constant(POINTER, None)


@lower(table.is_null)
def is_null(builder: Any, pointer: Any) -> Any:
    return builder.icmp_unsigned("==", pointer, ir.Constant(POINTER, None))


@infer_global(table.scratch)
class Scratch(AbstractTemplate):
    """Takes only a literal, because the size of a stack frame is fixed when it is compiled."""

    def generic(self, args: Any, kws: Any) -> Any:
        return TABLE(args[0]) if isinstance(args[0], types.IntegerLiteral) else None


@lower_builtin(table.scratch, types.IntegerLiteral)
def scratch(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    with builder.goto_entry_block():
        memory = builder.alloca(ir.ArrayType(I64, sig.args[0].literal_value))
        memory.align = 64
    return builder.bitcast(memory, POINTER)
