"""The lowering of mathlib/rng.py: integer multiply, shift and xor. `stream` and `word` also serve lanes of integers."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from sightray._jit import lower
from sightray.mathlib import rng


def _constant(like: Any, value: int) -> Any:
    """A number in the type of another, in all of its lanes."""
    kind = like.type
    return ir.Constant(kind, [value] * kind.count if isinstance(kind, ir.VectorType) else value)


def _mix(builder: Any, x: Any) -> Any:
    for shift, factor in rng.MIX:
        x = builder.mul(builder.xor(x, builder.lshr(x, _constant(x, shift))), _constant(x, factor))
    return builder.xor(x, builder.lshr(x, _constant(x, 31)))


@lower(rng.stream)
def stream(builder: Any, key: Any, index: Any) -> Any:
    golden = _constant(key, rng.GOLDEN)
    return _mix(builder, builder.add(_mix(builder, builder.add(key, golden)), builder.mul(index, golden)))


@lower(rng.word)
def word(builder: Any, key: Any, dimension: Any) -> Any:
    step = builder.mul(builder.add(dimension, _constant(key, 1)), _constant(key, rng.GOLDEN))
    return _mix(builder, builder.add(key, step))


@lower(rng.uniform)
def uniform(builder: Any, key: Any, dimension: Any) -> Any:
    bits = builder.lshr(word(builder, key, dimension), _constant(key, 11))
    return builder.fmul(builder.uitofp(bits, ir.DoubleType()), ir.Constant(ir.DoubleType(), 2.0**-53))
