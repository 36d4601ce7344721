"""One pool of threads for every kernel of this process.

Kernels release the interpreter lock and work on ranges; they are split here and nowhere else, so that two layers of
threads never fight over the same cores. `RELUME_THREADS` bounds the pool; worker processes set it to 1.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

# two shares even out a core that is busy with something else; more cost more to hand out than they win
_SHARES_A_THREAD = 2

_lock = threading.Lock()
_pool: ThreadPoolExecutor | None = None


def num_threads() -> int:
    """How many ranges run at once: `RELUME_THREADS`, or the cores this process may use."""
    asked = os.environ.get("RELUME_THREADS", "")
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(int(asked), 256)) if asked.isdigit() else available


def _shared_pool() -> ThreadPoolExecutor:
    global _pool
    with _lock:
        if _pool is None:
            _pool = ThreadPoolExecutor(num_threads(), thread_name_prefix="relume-kernel")
        return _pool


def for_ranges(kernel: Callable[[int, int], object], count: int, grain: int) -> None:
    """Call `kernel(start, stop)` over [0, count) in ranges of at most `grain`, on all threads of the pool.

    Ranges must not depend on each other. The first exception is raised here after all ranges have ended.
    """
    ranges = [(start, min(start + grain, count)) for start in range(0, count, grain)]
    if num_threads() == 1 or len(ranges) == 1:
        for start, stop in ranges:
            kernel(start, stop)
        return
    futures = [_shared_pool().submit(kernel, start, stop) for start, stop in ranges]
    errors = [error for future in futures if (error := future.exception()) is not None]
    if errors:
        raise errors[0]


def for_shares(kernel: Callable[[int, int], object], count: int) -> None:
    """Call `kernel(start, stop)` over [0, count) in a few even shares for each thread.

    For work of a few milliseconds, where handing out a range costs as much as doing it.
    """
    for_ranges(kernel, count, max(1, -(-count // (_SHARES_A_THREAD * num_threads()))))
