"""The lowering of mathlib/rng.py: integer multiply, shift and xor."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from sightray._jit import lower
from sightray.mathlib import rng

I64 = ir.IntType(64)


def _constant(value: int) -> Any:
    return ir.Constant(I64, value)


def _mix(builder: Any, x: Any) -> Any:
    for shift, factor in rng.MIX:
        x = builder.mul(builder.xor(x, builder.lshr(x, _constant(shift))), _constant(factor))
    return builder.xor(x, builder.lshr(x, _constant(31)))


@lower(rng.stream)
def stream(builder: Any, key: Any, index: Any) -> Any:
    inner = _mix(builder, builder.add(key, _constant(rng.GOLDEN)))
    return _mix(builder, builder.add(inner, builder.mul(index, _constant(rng.GOLDEN))))


@lower(rng.word)
def word(builder: Any, key: Any, dimension: Any) -> Any:
    step = builder.mul(builder.add(dimension, _constant(1)), _constant(rng.GOLDEN))
    return _mix(builder, builder.add(key, step))


@lower(rng.uniform)
def uniform(builder: Any, key: Any, dimension: Any) -> Any:
    bits = builder.lshr(word(builder, key, dimension), _constant(11))
    return builder.fmul(builder.uitofp(bits, ir.DoubleType()), ir.Constant(ir.DoubleType(), 2.0**-53))
