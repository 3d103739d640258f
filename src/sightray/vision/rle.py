"""Run lengths of masks as COCO has them: down the columns, beginning with a run of zeros that may be empty.

The text form packs each run, from the fourth on as its difference from the last but one before it, into groups of five
bits, low ones first, with a sixth bit that says that more follow, and adds 48 to make a character.
"""

from __future__ import annotations

import numpy as np


def run_lengths(mask: np.ndarray) -> list[int]:
    """Lengths of the runs of a mask, (height, width) bool, down its columns: zeros, ones, zeros ..."""
    flat = np.concatenate([[False], np.asarray(mask, bool).ravel(order="F")])
    changes = np.flatnonzero(flat[1:] != flat[:-1])
    return np.diff(np.concatenate([[0], changes, [mask.size]])).tolist()


def run_text(runs: list[int]) -> str:
    """Run lengths as COCO's text."""
    letters = []
    for i, run in enumerate(runs):
        value = run - runs[i - 2] if i > 2 else run
        more = True
        while more:
            low = value & 31
            value >>= 5
            more = value != (-1 if low & 16 else 0)
            letters.append(chr(48 + (low | 32 if more else low)))
    return "".join(letters)


def mask_of(runs: list[int], height: int, width: int) -> np.ndarray:
    """The mask, (height, width) bool, of run lengths."""
    values = np.arange(len(runs)) % 2 == 1
    return np.repeat(values, runs).reshape(width, height).T
