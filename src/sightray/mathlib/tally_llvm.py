"""The lowering of mathlib/tally.py: nothing at all, or the increment of a word of an external array."""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from sightray import _jit
from sightray._jit import lower
from sightray.mathlib import tally as source

I64 = ir.IntType(64)


@lower(source.tally)
def tally(builder: Any, kind: Any) -> None:
    if _jit.flavour.get() != source.COUNTING:
        return
    counts = builder.module.globals.get(source.SYMBOL)
    if counts is None:
        counts = ir.GlobalVariable(builder.module, ir.ArrayType(I64, 8), source.SYMBOL)
        counts.linkage = "external"
    word = builder.gep(counts, [ir.Constant(I64, 0), kind])
    builder.store(builder.add(builder.load(word), ir.Constant(I64, 1)), word)
