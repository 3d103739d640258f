"""Expressions in x, y and z: read without trust, turned into a small program, bounded along rays by a fixed kernel.

The user's text is parsed, never run: only the nodes named here are accepted, and what they become is a list of
instructions for a stack of spans (`mathlib.intervals`). A new expression therefore needs no compilation.
"""

from __future__ import annotations

import ast
import functools
import math
from typing import NoReturn

import numpy as np

from sightray.errors import SceneError, did_you_mean

(CONSTANT, X, Y, Z, COPY, ADD, MULTIPLY, LARGER, ANGLE, NEGATE, RECIPROCAL, POWER, SINE, TANGENT, EXPONENTIAL, LOGARITHM,
 ROOT, ABSOLUTE, HYPERBOLIC_TANGENT, ARCTANGENT) = range(20)  # fmt: skip
FIRST_BINARY, FIRST_UNARY = ADD, NEGATE
MAX_LENGTH, MAX_DEPTH, MAX_INSTRUCTIONS, MAX_STACK, MAX_EXPONENT = 2000, 150, 500, 32, 64

_NAMES = {"x": X, "y": Y, "z": Z}
_NUMBERS = {"pi": math.pi, "tau": math.tau, "e": math.e}
_OPERATORS = "+ - * / and ** with a constant exponent"
_UNARY: dict[str, tuple[tuple[int, float], ...]] = {  # what follows the argument
    "sin": ((SINE, 0),), "cos": ((CONSTANT, 0.5 * math.pi), (ADD, 0), (SINE, 0)), "tan": ((TANGENT, 0),),
    "exp": ((EXPONENTIAL, 0),), "log": ((LOGARITHM, 0),), "sqrt": ((ROOT, 0),), "abs": ((ABSOLUTE, 0),),
    "tanh": ((HYPERBOLIC_TANGENT, 0),), "atan": ((ARCTANGENT, 0),),
    "sinh": ((EXPONENTIAL, 0), (COPY, 0), (RECIPROCAL, 0), (NEGATE, 0), (ADD, 0), (CONSTANT, 0.5), (MULTIPLY, 0)),
    "cosh": ((EXPONENTIAL, 0), (COPY, 0), (RECIPROCAL, 0), (ADD, 0), (CONSTANT, 0.5), (MULTIPLY, 0)),
    "asin": ((COPY, 0), (POWER, 2), (NEGATE, 0), (CONSTANT, 1.0), (ADD, 0), (ROOT, 0), (ANGLE, 0)),
}  # fmt: skip
_UNARY["acos"] = (*_UNARY["asin"], (NEGATE, 0), (CONSTANT, 0.5 * math.pi), (ADD, 0))
_BINARY = ("min", "max", "atan2", "hypot", "pow")
_FUNCTIONS = (*_UNARY, *_BINARY)


def _fail(node: ast.AST | int, got: str, allowed: str) -> NoReturn:
    column = node if isinstance(node, int) else getattr(node, "col_offset", 0) + 1
    raise SceneError(f"column {column}: got {got}; allowed: {allowed}")


@functools.lru_cache(maxsize=256)
def compile_expression(text: str) -> np.ndarray:
    """The program of an expression: (n, 2) float64 words, whose first column holds int64 codes.

    Raises
    ------
    SceneError
        With the column, for anything but numbers, x y z, pi tau e, + - * / **, and the functions of `_FUNCTIONS`.
    """
    if len(text) > MAX_LENGTH:
        _fail(MAX_LENGTH + 1, f"{len(text)} characters", f"up to {MAX_LENGTH}")
    try:
        tree = ast.parse(text.replace("\n", " ").lstrip(), mode="eval")
    except SyntaxError as error:
        _fail(error.offset if error.offset is not None else 1, f"{text:.60}", f"an expression ({error.msg})")
    except (ValueError, RecursionError, MemoryError):
        _fail(1, f"{text:.60}", "an expression that can be read")
    program: list[tuple[int, float]] = []
    _emit(tree.body, program, 0)
    if len(program) > MAX_INSTRUCTIONS:
        _fail(1, f"{len(program)} operations", f"up to {MAX_INSTRUCTIONS}")
    height = top = 0
    for code, _ in program:
        height += 1 if code < FIRST_BINARY else -1 if code < FIRST_UNARY else 0
        top = max(top, height)
    if top > MAX_STACK:
        _fail(1, f"{top} values pending at once", f"up to {MAX_STACK}; regroup the terms")
    words = np.array(program, np.float64)
    words.view(np.int64)[:, 0] = [code for code, _ in program]
    words.flags.writeable = False
    return words


def _emit(node: ast.expr, program: list[tuple[int, float]], depth: int) -> None:
    """Append the instructions that leave the value of `node` on the stack."""
    if depth > MAX_DEPTH:
        _fail(node, "deeper nesting", f"up to {MAX_DEPTH} levels")
    if len(program) > MAX_INSTRUCTIONS:
        _fail(node, "more operations", f"up to {MAX_INSTRUCTIONS}")
    number = _constant(node)
    if number is not None:
        program.append((CONSTANT, number))
    elif isinstance(node, ast.Name) and node.id in _NAMES:
        program.append((_NAMES[node.id], 0))
    elif isinstance(node, ast.Name):
        known = (*_NAMES, *_NUMBERS)
        _fail(node, f"name '{node.id}'{did_you_mean(node.id, known)}", ", ".join(known))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        _emit(node.operand, program, depth + 1)
        if isinstance(node.op, ast.USub):
            program.append((NEGATE, 0))
    elif isinstance(node, ast.BinOp):
        _emit_operator(node, program, depth)
    elif isinstance(node, ast.Call):
        _emit_call(node, program, depth)
    else:
        _fail(node, type(node).__name__.lower(), f"numbers, x, y, z, {_OPERATORS}, functions ({', '.join(_FUNCTIONS)})")


def _emit_operator(node: ast.BinOp, program: list[tuple[int, float]], depth: int) -> None:
    if isinstance(node.op, ast.Pow):
        return _emit_power(node.left, node.right, program, depth)
    if not isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div):
        hint = " (a power is written **)" if isinstance(node.op, ast.BitXor) else ""
        _fail(node, f"operator {type(node.op).__name__.lower()}", _OPERATORS + hint)
    _emit(node.left, program, depth + 1)
    if isinstance(node.op, ast.Mult) and ast.dump(node.left) == ast.dump(node.right):
        program.append((POWER, 2))  # x * x is never negative, which a product of two unknowns could be
        return None
    _emit(node.right, program, depth + 1)
    if isinstance(node.op, ast.Sub):
        program.append((NEGATE, 0))
    if isinstance(node.op, ast.Div):
        program.append((RECIPROCAL, 0))
    program.append((ADD if isinstance(node.op, ast.Add | ast.Sub) else MULTIPLY, 0))
    return None


def _emit_power(base: ast.expr, by: ast.expr, program: list[tuple[int, float]], depth: int) -> None:
    exponent = _constant(by)
    if exponent is None or abs(exponent) > MAX_EXPONENT:
        _fail(by, "an exponent that varies" if exponent is None else f"exponent {exponent:g}",
              f"a constant from {-MAX_EXPONENT} to {MAX_EXPONENT}")  # fmt: skip
    _emit(base, program, depth + 1)
    size = abs(exponent)
    if size == int(size):
        program.append((POWER, int(size)))
    elif size == 0.5:
        program.append((ROOT, 0))
    else:
        program += [(LOGARITHM, 0), (CONSTANT, size), (MULTIPLY, 0), (EXPONENTIAL, 0)]
    if exponent < 0:
        program.append((RECIPROCAL, 0))


def _emit_call(node: ast.Call, program: list[tuple[int, float]], depth: int) -> None:
    name = node.func.id if isinstance(node.func, ast.Name) else "?"
    if name not in _FUNCTIONS or node.keywords:
        _fail(node, f"function '{name}'{did_you_mean(name, _FUNCTIONS)}", ", ".join(_FUNCTIONS))
    count = len(node.args)
    fits = count == 1 if name in _UNARY else count >= 2 if name in ("min", "max") else count == 2
    if not fits:
        _fail(node, f"{count} arguments of {name}", "one" if name in _UNARY else "two")
    if name == "pow":
        return _emit_power(node.args[0], node.args[1], program, depth)

    # min(a, b) = -max(-a, -b); hypot(a, b) = √(a² + b²); functions of two or more take them one after the other.
    for index, argument in enumerate(node.args):
        _emit(argument, program, depth + 1)
        if name in ("min", "hypot"):
            program.append((NEGATE, 0) if name == "min" else (POWER, 2))
        if index > 0:
            program.append(({"hypot": ADD, "atan2": ANGLE}.get(name, LARGER), 0))
    if name in ("min", "hypot"):
        program.append((NEGATE, 0) if name == "min" else (ROOT, 0))
    program += _UNARY.get(name, ())
    return None


def _constant(node: ast.expr) -> float | None:
    """The value of a number, a named number, or a sum, product or quotient of numbers; None for anything else."""
    if isinstance(node, ast.Constant):
        if isinstance(node.value, bool) or not isinstance(node.value, int | float) or not abs(node.value) < 1e100:
            _fail(node, f"{node.value!r:.40}", "numbers below 1e100")
        return float(node.value)
    if isinstance(node, ast.Name):
        return _NUMBERS.get(node.id)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _constant(node.operand) if isinstance(node.operand, ast.Constant | ast.Name) else None
        return None if value is None else -value
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
        parts = [_constant(part) if isinstance(part, ast.Constant) else None for part in (node.left, node.right)]
        if parts[0] is not None and parts[1]:
            return parts[0] / parts[1]
    return None
