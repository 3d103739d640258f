"""How kernels are compiled, cached and called: only this file and `_codegen` know.

A kernel is a plain Python function with every argument and its result annotated (``f64 i64 Vec3 Table`` ...)::

    @kernel
    def area(radius: f64) -> f64:
        return math.pi * radius * radius

Called from Python it simply runs, slowly, as Python: breakpoints, `explain` and the oracle tests use that.
`native` turns a kernel into machine code. Three kinds of functions may be called inside a kernel:

- another **kernel**: compiled with its own explicit signature and linked in;
- a **primitive** (`@primitive`): a few instructions (a vector product, a load), written twice: in Python where it
  stands, and as LLVM in the neighbouring module ``<module>_llvm``;
- a **method** (`@method`): a call through the function pointer that stands in the first words of a table row, so that a
  sphere's row knows how to intersect a sphere. Members say ``@implements(method, Class)``. A member is therefore
  compiled once for all scenes, only when a scene uses it, and only the methods that the called kernel can reach.

Machine code is kept in the user's cache folder, one file per kernel, named by a digest of every source file of this
package, of the kernel's own code where it stands outside, the versions of Numba, llvmlite and Python, and the
processor. Files are written aside and renamed, and carry a checksum, so that processes can race and files can rot
without harm. A warm start loads the object code with llvmlite alone: Numba is not even imported.

Set ``SIGHTRAY_JIT=0`` to run everything as plain Python, ``SIGHTRAY_CACHE_DIR`` to move the cache ("" for none). For
``SIGHTRAY_COMPILERS`` see `sightray._compilers`.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import importlib
import marshal
import os
import platform
import signal
import struct
import sys
import tempfile
import threading
import types
import typing
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

METHOD_SLOTS = 12  # words reserved for function pointers at the head of a row
_PACKAGE = Path(__file__).parent
_FAST_MATH = {"contract", "nsz"}  # fused multiply-add; never reassociation: results must not depend on the compiler
_lock = threading.RLock()
flavour: ContextVar[str] = ContextVar("flavour", default="")  # "counting": see mathlib.tally; each has its own code


def _cache(function: Callable) -> Any:
    """Remember results by argument and flavour."""

    @functools.cache
    def remembered(argument: Any, _: str) -> Any:
        return function(argument)

    return functools.wraps(function)(lambda argument: remembered(argument, flavour.get()))


def enabled() -> bool:
    """Whether kernels run as machine code (the default) or as plain Python (``SIGHTRAY_JIT=0``)."""
    return os.environ.get("SIGHTRAY_JIT", "1") != "0"


# ------------------------------------------------------------------------------------------ what kernels are made of


def kernel(function: F | None = None, *, exact: bool = False) -> Any:
    """Mark a kernel. With ``exact``, products and sums are not fused: ``a*b - c*d`` stays antisymmetric."""
    if function is None:
        return functools.partial(kernel, exact=exact)
    function.__kernel__ = {"exact": exact}  # type: ignore[attr-defined]
    return function


def primitive(function: F) -> F:
    """Mark `function` as having a lowering of the same name in the module ``<its module>_llvm``."""
    function.__primitive__ = True  # type: ignore[attr-defined]
    return function


def method(slot: int, form_of: tuple[Callable, ...] = ()) -> Callable[[F], F]:
    """Declare a family's method: a call through function pointer number `slot` of the row in its first argument.

    With `form_of` it does the same as other methods in another form, such as for eight paths: who implements one of these
    anew does not inherit it, but has what the family has by default.
    """

    def declare(function: F) -> F:
        @functools.wraps(function)
        def call(row: Any, *arguments: Any) -> Any:
            return row.method(slot)(row, *arguments)

        call.__method__, call.__forms__ = slot, []  # type: ignore[attr-defined]
        for other in form_of:
            other.__forms__.append(call)  # type: ignore[attr-defined]
        return typing.cast(F, call)

    return declare


def implements(declared: Callable, *classes: type) -> Callable[[F], F]:
    """Make the decorated function the kernel that carries out the method `declared` for `classes`."""

    def attach(function: F) -> F:
        kernel(function)
        for cls in classes:
            cls.kernels = {**getattr(cls, "kernels", {}), declared: function}  # type: ignore[attr-defined]
            for form in declared.__forms__:  # type: ignore[attr-defined]
                _forget_inherited(cls, form)
        return function

    return attach


def _forget_inherited(cls: Any, form: Callable) -> None:
    """Let go of what an ancestor does for a method, and do again what the family does by default, if anything."""
    above = [vars(base).get("kernels", {}) for base in cls.__mro__[1:]]
    inherited = next((kernels[form] for kernels in above if form in kernels), None)
    if inherited is None or cls.kernels[form] is not inherited:
        return
    root = next((base for base in cls.__mro__ if vars(base).get("family")), None)
    default = getattr(root, "kernels", {}).get(form)
    cls.kernels = {key: kept for key, kept in cls.kernels.items() if key is not form}
    if default is not None:
        cls.kernels[form] = default


def reachable(function: Callable) -> Iterator[Callable]:
    """Every kernel and method that `function` can call directly or through other kernels, itself included."""
    seen = {function}
    todo = [function]
    while todo:
        caller = todo.pop()
        yield caller
        if not hasattr(caller, "__kernel__"):
            continue
        scope = caller.__globals__  # type: ignore[attr-defined]
        for name in _names(caller.__code__):  # type: ignore[attr-defined]
            callee = scope.get(name)
            if isinstance(callee, types.FunctionType) and callee not in seen and _is_ours(callee):
                seen.add(callee)
                todo.append(callee)


def _is_ours(function: Callable) -> bool:
    return hasattr(function, "__kernel__") or hasattr(function, "__method__")


def needed_kernels(root: Callable, members: Iterable[type]) -> dict[type, dict[int, Callable]]:
    """For each member class, the kernels by slot that `root` can reach through methods of members in use."""
    members = list(members)
    needed: dict[type, dict[int, Callable]] = {member: {} for member in members}
    seen: set[Callable] = set()
    todo = [root]
    while todo:
        for callee in reachable(todo.pop()):
            if not hasattr(callee, "__method__") or callee in seen:
                continue
            seen.add(callee)
            for member in members:
                found = getattr(member, "kernels", {}).get(callee)
                if found is not None:
                    needed[member][callee.__method__] = found
                    todo.append(found)
    return needed


def _names(code: types.CodeType) -> set[str]:
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names |= _names(constant)
    return names


# ----------------------------------------------------------------------------------------------- compiling with Numba


def numba_type(annotation: Any) -> Any:
    """The Numba type of an annotation: scalars, vectors, tables, lanes, and (named) tuples of these."""
    from numba import types as nt

    scalars = {float: nt.float64, int: nt.int64, bool: nt.boolean, type(None): nt.none}
    if annotation in scalars:
        return scalars[annotation]
    if annotation.__module__ == "numpy":
        return getattr(nt, annotation.__name__)
    if hasattr(annotation, "_fields"):
        hints = typing.get_type_hints(annotation)
        members = [numba_type(hints[name]) for name in annotation._fields]
        if all(member == members[0] for member in members):
            return nt.NamedUniTuple(members[0], len(members), annotation)
        return nt.NamedTuple(members, annotation)
    if typing.get_origin(annotation) is tuple:
        return nt.Tuple([numba_type(part) for part in typing.get_args(annotation)])
    return _lowering(annotation.__module__).TYPES[annotation]


def signature(function: Callable) -> Any:
    """The Numba signature that the annotations of `function` state."""
    hints = typing.get_type_hints(function)
    code = getattr(function, "__wrapped__", function).__code__
    arguments = [numba_type(hints[name]) for name in code.co_varnames[: code.co_argcount]]
    return numba_type(hints["return"])(*arguments)


@functools.cache
def _lowering(module: str) -> types.ModuleType:
    return importlib.import_module(f"{module}_llvm")


def lower(function: Callable, sig: Any = None) -> Callable[[F], F]:
    """Teach Numba that calls of `function` become what the decorated ``generate(builder, *values)`` emits."""
    from numba.core.typing.templates import AbstractTemplate, infer_global
    from numba.extending import lower_builtin

    sig = sig or signature(function)

    def attach(generate: F) -> F:
        class Template(AbstractTemplate):
            def generic(self, args: Any, kws: Any) -> Any:
                return sig if len(args) == len(sig.args) else None

        infer_global(function)(Template)

        @lower_builtin(function, *sig.args)
        def lowered(context: Any, builder: Any, call_sig: Any, arguments: Any) -> Any:
            result = generate(builder, *arguments)
            return context.get_dummy_value() if result is None else result

        return generate

    return attach


@functools.cache
def _teach_method(declared: Callable) -> None:
    """Lower calls of a method to a call through the function pointer in its slot of the first argument."""
    from llvmlite import ir
    from numba.core.typing.templates import AbstractTemplate, infer_global
    from numba.extending import lower_builtin

    sig = signature(declared)
    slot = ir.Constant(ir.IntType(64), declared.__method__)  # type: ignore[attr-defined]

    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            return sig if len(args) == len(sig.args) else None

    infer_global(declared)(Template)

    @lower_builtin(declared, *sig.args)
    def lowered(context: Any, builder: Any, call_sig: Any, arguments: Any) -> Any:
        convention = context.call_conv
        kind = convention.get_function_type(sig.return_type, sig.args).as_pointer()
        slots = builder.bitcast(arguments[0], kind.as_pointer())
        target = builder.load(builder.gep(slots, [slot]), align=8)
        return convention.call_function(builder, target, sig.return_type, sig.args, arguments)[1]


def _linked(function: Callable) -> types.FunctionType:
    """A copy of `function` whose globals name compiled kernels in place of Python functions."""
    scope = dict(function.__globals__)  # type: ignore[attr-defined]
    for name in _names(function.__code__):  # type: ignore[attr-defined]
        value = scope.get(name)
        if hasattr(value, "__kernel__"):
            scope[name] = _dispatcher(value)
        elif hasattr(value, "__primitive__"):
            _lowering(value.__module__)
        elif hasattr(value, "__method__"):
            _teach_method(value)
    copy = types.FunctionType(function.__code__, scope, function.__name__, function.__defaults__)  # type: ignore[attr-defined]
    copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
    return copy


@_cache
def _dispatcher(function: Callable) -> Any:
    """The compiled Numba dispatcher of a kernel."""
    import numba

    sig = signature(function)
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # only `native` calls from Python
    options["fastmath"] = False if function.__kernel__["exact"] else _FAST_MATH  # type: ignore[attr-defined]
    dispatcher = numba.njit(**options)(_linked(function))
    dispatcher.compile(sig)
    dispatcher.disable_compile()
    return dispatcher


class ObjectCode(NamedTuple):
    """One kernel with all that it calls, as a relocatable object file."""

    symbol: str
    needs: tuple[str, ...]  # external symbols (sin, pow, ...) that must be there before the linker is asked
    code: bytes


@contextlib.contextmanager
def interrupts_put_off() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block: LLVM calls back into Python, where an exception would be lost."""
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    came: list[tuple[Any, Any]] = []
    signal.signal(signal.SIGINT, lambda number, frame: came.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if came:
        handler(*came[0])


def _compile(function: Callable) -> ObjectCode:
    from sightray._codegen import late_code

    with _lock, interrupts_put_off(), late_code():
        dispatcher = _dispatcher(function)
        (result,) = dispatcher.overloads.values()
        module = result.library.optimized()
        needs = [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")]
        return ObjectCode(result.fndesc.mangled_name, tuple(needs), _machine().emit_object(module))


# ---------------------------------------------------------------------------------------------------------- the cache


def cache_folder() -> Path | None:
    """Where machine code is kept, or None where nothing can be written."""
    chosen = os.environ.get("SIGHTRAY_CACHE_DIR")
    if chosen == "":
        return None
    if chosen is None:
        import platformdirs

        chosen = platformdirs.user_cache_dir("sightray", appauthor=False)
    folder = Path(chosen)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder


@functools.cache
def _environment_digest() -> str:
    """Digest of all that decides what the compiler emits: our sources, the compilers, the processor."""
    import llvmlite.binding as llvm

    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    features = llvm.get_host_cpu_features()
    parts = (metadata.version("numba"), metadata.version("llvmlite"), sys.version, platform.platform(),
             llvm.get_host_cpu_name(), features.flatten())  # fmt: skip
    digest.update(repr(parts).encode())
    return digest.hexdigest()


def _key(function: Callable) -> str:
    digest = hashlib.sha256(_environment_digest().encode())
    digest.update(f"{flavour.get()} {function.__module__}.{function.__qualname__}".encode())
    for callee in sorted(reachable(function), key=lambda f: (f.__module__, f.__qualname__)):
        code = getattr(callee, "__wrapped__", callee).__code__
        if not Path(code.co_filename).is_relative_to(_PACKAGE):
            digest.update(marshal.dumps(code) + repr(_constants(callee, code)).encode())
    return digest.hexdigest()[:32]


def _constants(function: Callable, code: types.CodeType) -> list[tuple[str, Any]]:
    """Global numbers that a kernel reads: the compiler takes them for constants."""
    scope = function.__globals__  # type: ignore[attr-defined]
    return [(name, scope[name]) for name in sorted(_names(code)) if isinstance(scope.get(name), int | float)]


def _cache_path(function: Callable) -> Path | None:
    folder = cache_folder()
    return (
        None
        if folder is None
        else folder / f"{function.__qualname__.replace('<', '').replace('>', '')}-{_key(function)}.o"
    )


def _read(path: Path | None) -> ObjectCode | None:
    """The object code in a cache file, or None if there is none or it is damaged."""
    try:
        data = path.read_bytes() if path is not None else b""
    except OSError:
        return None
    checksum, body = data[:32], data[32:]
    if len(data) < 36 or hashlib.sha256(body).digest() != checksum:
        return None
    (size,) = struct.unpack_from("<I", body)
    symbol, *needs = body[4 : 4 + size].decode().split("\n")
    return ObjectCode(symbol, tuple(n for n in needs if n), body[4 + size :])


def _write(path: Path | None, unit: ObjectCode) -> None:
    if path is None:
        return
    header = "\n".join((unit.symbol, *unit.needs)).encode()
    body = struct.pack("<I", len(header)) + header + unit.code
    try:
        handle, aside = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "wb") as file:
            file.write(hashlib.sha256(body).digest() + body)
        os.replace(aside, path)
    except OSError:  # a full or read-only disk costs time, not correctness
        return


# ------------------------------------------------------------------------------------------------ loading and calling


_engines: list[Any] = []  # machine code lives as long as its engine


def _machine() -> Any:
    """A code generator for this processor with all that it can do."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(),
        opt=3, jit=True, codemodel="jitdefault",
    )  # fmt: skip


def _load(unit: ObjectCode) -> int | None:
    """Link object code into the process: the address of its function, or None if a symbol is missing."""
    import llvmlite.binding as llvm

    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())  # from now on, LLVM sees our own symbols
    if not all(_find_symbol(name) for name in unit.needs):
        return None
    engine.add_object_file(llvm.ObjectFileRef.from_data(unit.code))
    engine.finalize_object()
    _engines.append(engine)
    return engine.get_function_address(unit.symbol)


def _find_symbol(name: str) -> bool:
    """Whether the linker will find an external symbol; functions of the C library are looked up where it does not."""
    import llvmlite.binding as llvm

    if llvm.address_of_symbol(name) is not None:
        return True
    library = {"linux": "libm.so.6", "win32": "ucrtbase.dll", "darwin": None}.get(sys.platform)
    try:
        found = ctypes.cast(getattr(ctypes.CDLL(library), name), ctypes.c_void_p).value
    except (OSError, AttributeError):
        return False
    llvm.add_symbol(name, found)
    return True


_at_hand: set[tuple[Callable, str]] = set()  # kernels whose file was seen in the cache, and their flavour


@_cache
def address(function: Callable) -> int:
    """Address of the machine code of a kernel; compiled only if the cache does not have it."""
    with _lock:
        path = _cache_path(function)
        unit = _read(path)
        found = _load(unit) if unit is not None else None
        if found is None:
            compiled = _compile(function)
            _write(path, compiled)
            found = _load(compiled)
            if found is None:
                raise RuntimeError(f"cannot link {function.__qualname__}: a symbol is missing of {compiled.needs}")
        return found


def compile_into_cache(function: Callable) -> None:
    """Write the machine code of a kernel into the cache without loading it."""
    _write(_cache_path(function), _compile(function))


def is_compiled(function: Callable) -> bool:
    """Whether machine code for a kernel is at hand, in this process or in the cache."""
    asked = function, flavour.get()
    if asked not in _at_hand:  # to find the file takes longer than a small picture
        path = _cache_path(function)
        if path is None or not path.exists():
            return False
        _at_hand.add(asked)
    return True


@_cache
def native(function: Callable) -> Callable:
    """A Python callable that runs a kernel as machine code without the GIL (or as Python where compiling is off).

    Arguments are Table, int or float as annotated; the result is None, int or float.
    """
    if not enabled():
        return function
    hints = typing.get_type_hints(function)
    code = function.__code__  # type: ignore[attr-defined]
    kinds = [hints[name] for name in code.co_varnames[: code.co_argcount]]
    ctype: dict[Any, Any] = {int: ctypes.c_int64, float: ctypes.c_double}
    result = ctype.get(hints["return"], ctypes.c_int64)
    prototype = ctypes.CFUNCTYPE(
        ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *(ctype.get(kind, ctypes.c_void_p) for kind in kinds)
    )
    call = prototype(address(function))
    is_table = [kind not in ctype for kind in kinds]

    def run(*arguments: Any) -> Any:
        out, error = result(), ctypes.c_void_p()
        values = [a.address if table else a for a, table in zip(arguments, is_table, strict=True)]
        call(ctypes.addressof(out), ctypes.addressof(error), *values)
        return out.value

    return run
