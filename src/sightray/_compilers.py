"""Other processes that help to compile: the first picture of a new kind waits for that, and cores would be idle.

Numba compiles one kernel at a time in a process. So where many are missing from the cache, helpers are started, as many as
there are other cores, up to three. Each is handed the names of kernels, one after the other and the longest first, and
writes their machine code into the cache, from where this process loads it. A helper that fails is done without.

``SIGHTRAY_COMPILERS`` says how many processes compile at once, this one included; 1 for no helpers.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable

from sightray import _jit

FEWEST = 8  # missing kernels for which helpers are worth their own start, about a second
MOST = 4  # processes
PATIENCE = 120.0  # seconds that a helper may take for its last kernel


def compile_missing(kernels: list[Callable], cores: int, report: Callable[[int, int, str], None] | None = None) -> None:
    """Fill the cache with the machine code of those kernels that it does not have, and load it.

    `report` is told how many are done, how many there are, and the name of the next.
    """
    missing = sorted((k for k in kernels if not _jit.is_compiled(k)), key=_size, reverse=True)
    if not missing:
        return
    queue = deque(missing)
    helpers = [_Helper(queue) for _ in range(_helpers_for(missing, cores))]
    try:
        while (kernel := _next(queue, helpers)) is not None:
            if report is not None:
                report(len(missing) - len(queue) - 1, len(missing), kernel.__name__)
            _jit.address(kernel)
    finally:
        for helper in helpers:
            helper.end()
    if report is not None:
        report(len(missing), len(missing), "")


def _next(queue: deque[Callable], helpers: list[_Helper]) -> Callable | None:
    """The next kernel to compile, or None if none is left, and no helper is at one that it might put back."""
    while True:
        busy = [helper for helper in helpers if helper.is_alive()]
        try:
            return queue.popleft()
        except IndexError:
            if not busy:
                return None
        busy[0].join(PATIENCE)
        if busy[0].is_alive():
            busy[0].process.kill()


def _size(kernel: Callable) -> int:
    """About how much there is to compile: the length of all byte code that a kernel reaches without a method's call."""
    return sum(len(f.__code__.co_code) for f in _jit.reachable(kernel) if hasattr(f, "__kernel__"))


def _helpers_for(missing: list[Callable], cores: int) -> int:
    """How many helpers to start."""
    nobody = not sys.executable or getattr(sys, "frozen", False)  # no Python to be started
    if nobody or len(missing) < FEWEST or _jit.cache_folder() is None:
        return 0
    try:
        wanted = int(os.environ["SIGHTRAY_COMPILERS"])
    except (KeyError, ValueError):
        wanted = min(cores, MOST)
    return max(0, wanted - 1)


class _Helper(threading.Thread):
    """A thread that hands kernels of the queue to a process of its own."""

    def __init__(self, queue: deque[Callable]):
        super().__init__(daemon=True)
        self.queue = queue
        places = os.pathsep.join(place for place in sys.path if place)
        command = [sys.executable, "-m", "sightray._compilers", _jit.flavour.get()]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            env={**os.environ, "PYTHONPATH": places},
        )  # fmt: skip
        self.start()

    def run(self) -> None:
        """Until the queue is empty, or the process fails: then what it was at goes back."""
        theirs: list[Callable] = []
        while True:
            try:
                kernel = self.queue.popleft()
            except IndexError:
                break
            if not _is_importable(kernel):
                theirs.append(kernel)  # defined where another process cannot find it
                continue
            if not self._ask(f"{kernel.__module__} {kernel.__qualname__}"):
                theirs.append(kernel)
                break
        self.queue.extend(theirs)

    def _ask(self, name: str) -> bool:
        """Have one kernel compiled."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        try:
            self.process.stdin.write(name + "\n")
            self.process.stdin.flush()
            return self.process.stdout.readline().strip() == name
        except OSError:
            return False

    def end(self) -> None:
        """Let the process go."""
        self.process.kill()
        self.process.communicate()


def _is_importable(kernel: Callable) -> bool:
    """Whether a kernel's name leads to it."""
    return kernel.__module__.startswith("sightray.") and "<" not in kernel.__qualname__


def _serve(flavour: str) -> None:
    """What a helper does: compile each kernel that a line names, and say the name when it is in the cache."""
    _jit.flavour.set(flavour)
    for line in sys.stdin:
        module, name = line.split()
        kernel = getattr(importlib.import_module(module), name)
        if not _jit.is_compiled(kernel):
            _jit.compile_into_cache(kernel)
        print(line.strip(), flush=True)


if __name__ == "__main__":
    _serve(sys.argv[1])
