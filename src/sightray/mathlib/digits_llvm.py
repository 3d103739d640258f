"""The lowering of mathlib/digits.py."""

from __future__ import annotations

from typing import Any

from sightray._jit import lower
from sightray.mathlib import digits


@lower(digits.reverse_bits)
def reverse_bits(builder: Any, x: Any) -> Any:
    return builder.bitreverse(x)
