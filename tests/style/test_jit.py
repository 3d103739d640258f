"""The compiler's promises: same numbers as Python, a cache that survives races and rot, no Numba on a warm start."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sightray import _jit
from sightray._jit import implements, kernel, method, native, needed_kernels
from sightray.mathlib.rng import stream, uniform
from sightray.mathlib.scalars import f64, i64
from sightray.mathlib.table import (
    Space,
    Table,
    advance,
    f32_at,
    f32_put,
    f64_at,
    f64_put,
    i32_at,
    i32_put,
    i64_at,
    i64_put,
    is_null,
    link,
    scratch,
    set_methods,
    table_at,
    vec3_at,
    vec3_put,
)  # fmt: skip
from sightray.mathlib.vec import Vec3, cross, dot, grey, length, max3, normalize, vabs, vexp, vmax, vmin


@kernel
def vector_operations(numbers: Table, out: Table) -> None:
    a, b, s = vec3_at(numbers, 0), vec3_at(numbers, 4), f64_at(numbers, 8)
    results = scratch(64)
    vec3_put(results, 0, a + b * s - 2.0 * a / b + 1.0 / b)
    vec3_put(results, 4, cross(a, b))
    vec3_put(results, 8, normalize(a) + vmin(a, b) + vmax(a, -b) + vabs(a) + grey(s))
    vec3_put(results, 12, Vec3(dot(a, b), length(a), max3(b)) + vexp(a * 0.1))
    a += b
    a *= s
    a -= grey(1.0)
    a /= 3.0
    vec3_put(results, 16, Vec3(a.z, a.y, a.x, a.w))
    for k in range(20):
        f64_put(out, k, f64_at(results, k))


def _run(function, numbers, words=32):
    space = Space()
    results = []
    for call in (function, native(function)):
        out = space.array(np.zeros(words))
        call(space.array(np.asarray(numbers, np.float64)), out)
        results.append(out.view(np.float64).copy())
    return results


def test_vectors_compute_the_same_in_python_and_in_machine_code():
    rng = np.random.default_rng(1)
    for _ in range(20):
        python, machine = _run(vector_operations, rng.normal(size=16))
        np.testing.assert_allclose(machine, python, rtol=1e-12, atol=1e-12)


@kernel
def integer_operations(numbers: Table, out: Table) -> None:
    for k in range(6):
        key = stream(i64_at(numbers, 0), k)
        f64_put(out, k, uniform(key, 3))
        i64_put(out, 8 + k, key)
    i32_put(out, 40, -7)
    f32_put(out, 41, 0.1)
    f64_put(out, 21, float(i32_at(out, 40)) + float(f32_at(out, 41)))
    f64_put(advance(out, 2), 20, 5.0)
    f64_put(out, 23, 1.0 if is_null(table_at(numbers, 1)) else 2.0)


def test_tables_and_random_numbers_are_the_same_to_the_bit():
    python, machine = _run(integer_operations, np.zeros(4))
    assert python.tobytes() == machine.tobytes()
    assert machine[22] == 5.0
    assert machine[21] == -7 + float(np.float32(0.1))
    assert machine[23] == 1.0


def test_random_numbers_are_uniform_and_streams_are_independent():
    numbers = np.array([[uniform(stream(7, k), d) for d in range(4)] for k in range(5000)])
    counts = np.stack([np.histogram(column, 16, (0, 1))[0] for column in numbers.T])
    chi2 = ((counts - 312.5) ** 2 / 312.5).sum(axis=1)
    assert (chi2 < 37.7).all()  # 15 degrees of freedom, p = 0.001
    assert np.abs(np.corrcoef(numbers.T) - np.eye(4)).max() < 4 / math.sqrt(5000)


@method(0)
def volume(body: Table, scale: f64) -> f64:
    """Declared for the members below."""
    raise NotImplementedError


class Cube:
    pass


class Ball:
    pass


@implements(volume, Cube)
def volume_of_cube(body: Table, scale: f64) -> f64:
    return scale * f64_at(body, 8) ** 3.0


@implements(volume, Ball)
def volume_of_ball(body: Table, scale: f64) -> f64:
    return scale * 4.0 / 3.0 * math.pi * f64_at(body, 8) ** 3.0


@kernel
def total_volume(bodies: Table, count: i64) -> f64:
    total = 0.0
    for k in range(count):
        total += volume(table_at(bodies, k), 2.0)
    return total


def test_methods_call_through_the_row():
    space = Space()
    bodies = space.row(8)
    needed = needed_kernels(total_volume, [Cube, Ball])
    assert needed == {Cube: {0: volume_of_cube}, Ball: {0: volume_of_ball}}
    for k, (cls, size) in enumerate([(Cube, 2.0), (Ball, 1.0), (Cube, 1.0)]):
        row = space.row(16)
        row.view(np.float64)[8] = size
        set_methods(row, [(slot, f, _jit.address(f)) for slot, f in needed[cls].items()])
        link(bodies, k, row)
    expected = 2 * (8 + 4 / 3 * math.pi + 1)
    assert total_volume(bodies, 3) == pytest.approx(expected, rel=1e-14)
    assert native(total_volume)(bodies, 3) == pytest.approx(expected, rel=1e-14)


PROGRAM = """
import sys
import numpy as np
from sightray._jit import native
from sightray.mathlib.table import Table
from sightray.film.film import add_sample
import sightray.filters.table as ft
from sightray._jit import address
address(ft.sample_filter)
print("numba" in sys.modules)
"""


def _start(folder, **environment):
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "SIGHTRAY_CACHE_DIR": str(folder), "SIGHTRAY_JIT": "1", **environment},
    )  # fmt: skip


def _finish(process):
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    return out.strip()


def test_cache_survives_races_and_rot_and_spares_numba(tmp_path):
    together = [_start(tmp_path) for _ in range(2)]
    assert {_finish(process) for process in together} == {"True"}
    (cached,) = tmp_path.glob("sample_filter-*.o")
    assert not list(tmp_path.glob("*.tmp"))
    assert _finish(_start(tmp_path)) == "False"
    intact = cached.read_bytes()
    for damaged in (b"", intact[:100], intact[:-1], intact[:50] + b"\xff" + intact[51:]):
        cached.write_bytes(damaged)
        assert _finish(_start(tmp_path)) == "True"
        assert cached.read_bytes()[:32] != damaged[:32] or cached.read_bytes() == intact


def test_runs_where_nothing_can_be_cached(tmp_path):
    blocker = tmp_path / "file"
    blocker.write_text("not a folder")
    assert _finish(_start(blocker / "cache")) == "True"
    assert _finish(_start("")) == "True"


def test_cache_key_covers_sources_and_user_kernels(monkeypatch):
    key = _jit._key(total_volume)
    original = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: original(path) + b"# edited")
    _jit._environment_digest.cache_clear()
    assert _jit._key(total_volume) != key
    monkeypatch.undo()
    _jit._environment_digest.cache_clear()
    assert _jit._key(total_volume) == key


def test_private_api_of_numba_is_as_expected():
    """The two things that are not public: the library's final module, and the calling convention."""
    import numba
    from numba.core.registry import cpu_target

    compiled = numba.njit("f8(f8)")(lambda x: x + 1.0)
    (result,) = compiled.overloads.values()
    assert any(f.name == result.fndesc.mangled_name for f in result.library._final_module.functions)
    assert hasattr(cpu_target.target_context.call_conv, "call_function")


def test_an_interrupt_while_a_kernel_is_compiled_comes_afterwards():
    earlier, steps = signal.signal(signal.SIGINT, signal.default_int_handler), []

    def compile_block():
        with _jit.interrupts_put_off():
            signal.raise_signal(signal.SIGINT)
            steps.append("compiled")
        steps.append("never")

    try:
        with pytest.raises(KeyboardInterrupt):
            compile_block()
        assert steps == ["compiled"]
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        with _jit.interrupts_put_off():
            pass
    finally:
        signal.signal(signal.SIGINT, earlier)


@kernel
def floor_of(x: f64) -> f64:
    return np.floor(x) + round(x)


def test_other_users_of_numba_are_not_disturbed():
    """Kernels wait for their machine code until all is together; what others compile meanwhile or afterwards works."""
    numba = pytest.importorskip("numba")
    assert native(floor_of)(2.7) == 5.0

    @numba.njit
    def theirs(x):
        return np.floor(x) + round(x)

    assert theirs(-0.5) == -1.0
    assert native(floor_of)(-0.5) == -1.0
