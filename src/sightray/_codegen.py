"""Numba as a front end: what it makes of kernels is put together first, and becomes machine code once.

Numba optimises every function that it compiles, with all that it calls, and turns it into machine code, for it may be called
from Python. Kernels call one another, so the innermost ones would be optimised, and translated, many times over; only what
comes of the outermost is used. Here a function's module waits as it is until it is a part of another one.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator
from typing import Any

from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target


class Library(JITCodeLibrary):
    """The module of one function, and those of what it calls."""

    def optimized(self) -> Any:
        """The LLVM module with all that it needs, optimised as a whole; to be asked once, of the outermost function."""
        super()._optimize_final_module()
        return self._final_module

    def _optimize_functions(self, ll_module: Any) -> None:
        """Not yet; but say how numbers lie in memory."""
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        """Not yet."""

    def _finalize_specific(self) -> None:
        """No machine code."""

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0


class _Codegen(JITCPUCodegen):
    """Who makes such libraries; no engine ever sees them."""

    _library_class = Library

    def _add_module(self, module: Any) -> None:
        pass

    def set_env(self, env_name: str, env: Any) -> None:
        pass


@functools.cache
def _codegen() -> _Codegen:
    return _Codegen("sightray")


@contextlib.contextmanager
def late_code() -> Iterator[None]:
    """Let Numba make such libraries, and nobody else compile meanwhile."""
    with global_compiler_lock:
        context = cpu_target.target_context
        usual = context._internal_codegen
        context._internal_codegen = _codegen()
        try:
            yield
        finally:
            context._internal_codegen = usual
