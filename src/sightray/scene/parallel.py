"""Chunks of a batch on all cores: the calling thread takes part, others come from one pool for the process."""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait

import numpy as np

from sightray.mathlib.cores import core_count
from sightray.mathlib.table import Table, aligned

FEW = 2048  # rays that are not worth waking a thread: a tenth of a millisecond
SHARE = 3  # a chunk takes one part in so many, for each thread, of what is left: short ones so that all end together
LEAST, MOST = 8192, 32768  # rays of a chunk: many, lest Python have much to do; few enough to be converted in passing
POLL = 0.1  # seconds between looks at the keyboard

_NEVER = Table(aligned(1, np.int64))  # the stop word of small batches
_lock = threading.Lock()
_pool: ThreadPoolExecutor | None = None
_pool_size = 0


def _forget_pool() -> None:
    global _lock, _pool, _pool_size
    _lock, _pool, _pool_size = threading.Lock(), None, 0


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_pool)  # threads do not survive a fork


def _start(helpers: int, work: Callable[[], None]) -> list[Future]:
    global _pool, _pool_size
    with _lock:
        if _pool is None or _pool_size < helpers:
            if _pool is not None:
                _pool.shutdown(wait=False)
            _pool, _pool_size = ThreadPoolExecutor(helpers, thread_name_prefix="sightray"), helpers
        return [_pool.submit(work) for _ in range(helpers)]


def chunks_of(n: int, threads: int, chunk: int = 0) -> list[tuple[int, int]]:
    """First and last of the rays of each chunk; all begin at multiples of 256, because kernels take as many at a time."""
    chunks, first = [], 0
    least = min(LEAST, max(FEW, n // (2 * threads)))  # of few rays, too, everybody gets some
    while first < n:
        size = chunk or min(max((n - first) // (SHARE * threads), least), MOST) // 256 * 256
        chunks.append((first, min(first + size, n)))
        first += size
    return chunks


def run_chunks(n: int, work: Callable[[int, int, Table], None], threads: int | None = None, chunk: int = 0) -> None:
    """Call ``work(first, last, stop)`` for all chunks of n rays, on several threads.

    On Ctrl-C, and when a chunk fails, the stop word is set: kernels look at it, no chunk is begun, and the exception is
    raised when all threads have come to rest.
    """
    if n <= FEW:
        if n > 0:
            work(0, n, _NEVER)
        return
    stop = Table(aligned(1, np.int64))
    threads = core_count() if threads is None else threads
    chunks = chunks_of(n, threads, chunk)
    helpers = min(threads, len(chunks)) - 1
    queue = itertools.count()
    word = stop.view(np.int64)

    def take() -> None:
        try:
            while word[0] == 0 and (number := next(queue)) < len(chunks):
                work(*chunks[number], stop)
        except BaseException:
            word[0] = 1
            raise

    running = _start(helpers, take) if helpers > 0 else []
    try:
        take()
        while wait(running, POLL).not_done:
            for future in running:
                future.cancel()  # what has not begun finds nothing left to do
    except BaseException:
        word[0] = 1
        wait(running)
        raise
    for future in running:
        if not future.cancelled():
            future.result()
