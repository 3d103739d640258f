"""The lowering of mathlib/distribution.py."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from sightray._jit import lower
from sightray.mathlib import distribution

I64 = ir.IntType(64)


@lower(distribution.step_if)
def step_if(builder: Any, half: Any, y: Any, x: Any) -> Any:
    """Shifted by 32 where the difference of the bits is negative: compilers know comparisons, masks and factors."""
    difference = builder.sub(builder.bitcast(x, I64), builder.bitcast(y, I64))
    return builder.lshr(half, builder.and_(builder.lshr(difference, I64(58)), I64(32)))
