"""The threads for every kernel of this process: pools for what a frame waits for, for what follows, and for long work.

Kernels release the interpreter lock and work on ranges; they are split here and nowhere else, so that two layers of
threads never fight over the same cores. A freeze hands out hundreds of ranges at once, which a frame's few must not
queue behind: who calls decides whose threads work, and where both want a core the system gives frames most of it.
Where as many frames are made at once as there are threads, each is made by its own: handing out ranges, and waiting for
them, would only cost. `RELUME_THREADS` bounds each pool; worker processes set it to 1.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import ParamSpec, TypeVar

from relume.core.errors import CancelledError

P = ParamSpec("P")
T = TypeVar("T")
Item = TypeVar("Item")
Kernel = Callable[[int, int], object]
"""Works on a range: its start and its stop."""

# two shares even out a core that is busy with something else; more cost more to hand out than they win
_CHUNKS_PER_THREAD = 2

# asked once: of an edit's frame of three milliseconds, asking at every kernel took a third of one
_AVAILABLE = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

_FRAME, _LOW_PRIORITY, _LONG = "frame", "beside", "long"
# where both want a core, frames get three quarters of it from long work, and nearly all from what follows them, which
# takes no more than every other core: with both cores of two an edit's frame of 4 ms took 5
_NICE = {_FRAME: 0, _LOW_PRIORITY: 19, _LONG: 5}

_lock = threading.Lock()
_thread_state = threading.local()  # pool: that this thread's kernels go to. is_of_pool: it is one of those that work
_pools: dict[str, ThreadPoolExecutor] = {}
_frame_threads: list[int] = []  # threads that make them


def num_threads() -> int:
    """How many ranges run at once: `RELUME_THREADS`, or the cores this process may use."""
    requested = os.environ.get("RELUME_THREADS", "")
    return max(1, min(int(requested), 256)) if requested.isdigit() else _AVAILABLE


def _pool(name: str) -> ThreadPoolExecutor:
    with _lock:
        if name not in _pools:
            num = max(1, num_threads() // 2) if name == _LOW_PRIORITY else num_threads()
            _pools[name] = ThreadPoolExecutor(num, f"kernels-{name}", _init_worker, (name,))
        return _pools[name]


def _init_worker(name: str) -> None:
    _thread_state.is_of_pool = True
    if _NICE[name] and sys.platform == "linux":  # elsewhere it would be of the whole process
        with suppress(OSError):  # not allowed to
            os.setpriority(os.PRIO_PROCESS, 0, os.getpriority(os.PRIO_PROCESS, 0) + _NICE[name])


def mark_background_thread() -> None:
    """From now on kernels that this thread calls let those of frames go first; nobody waits for them."""
    _thread_state.pool = _LONG


@contextmanager
def low_priority() -> Iterator[None]:
    """Inside, kernels that this thread calls let those of frames go first, and do not queue behind long work."""
    before = getattr(_thread_state, "pool", _FRAME)
    _thread_state.pool = _LOW_PRIORITY
    try:
        yield
    finally:
        _thread_state.pool = before


def run_frame(work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Call what makes a frame in this thread; while many do, each keeps to its own core.

    Args:
        work: is called. args, kwargs: with these.
    Returns:
        What it returns.
    """
    _frame_threads.append(threading.get_ident())
    try:
        return work(*args, **kwargs)
    finally:
        _frame_threads.remove(threading.get_ident())


def _is_crowded(pool: str) -> bool:
    """Whether all cores have frames of their own to make."""
    return pool == _FRAME and len(_frame_threads) >= max(2, num_threads())


def _run(kernel: Kernel, count: int, grain: int) -> None:
    ranges = [(start, min(start + grain, count)) for start in range(0, count, grain)]
    # a thread of a pool that waited for its own pool would wait for itself
    name = getattr(_thread_state, "pool", _FRAME)
    if num_threads() == 1 or len(ranges) == 1 or getattr(_thread_state, "is_of_pool", False) or _is_crowded(name):
        for start, stop in ranges:
            kernel(start, stop)
        return
    if name == _FRAME:
        _run_cooperatively(kernel, ranges)
        return
    futures = [_pool(name).submit(kernel, start, stop) for start, stop in ranges]
    errors = [error for future in futures if (error := future.exception()) is not None]
    if errors:
        raise errors[0]


def _run_cooperatively(kernel: Kernel, ranges: Sequence[tuple[int, int]]) -> None:
    """Work through ranges with threads of the pool, whoever is free taking the next.

    The caller works, too: threads that wait are woken late, which took a quarter of a frame of three milliseconds.
    """
    remaining = iter(ranges)  # whose next is one thread's, by the interpreter's lock

    def work() -> list[BaseException]:
        return [error for start, stop in remaining if (error := _capture_error(kernel, start, stop)) is not None]

    futures = [_pool(_FRAME).submit(work) for _ in range(min(num_threads(), len(ranges)) - 1)]
    errors = work()
    for future in futures:
        if not future.cancel():  # else it would find nothing left
            errors += future.result()
    if errors:
        raise errors[0]


def _capture_error(kernel: Kernel, start: int, stop: int) -> BaseException | None:
    try:
        kernel(start, stop)
    except BaseException as error:  # raised when all ranges have ended
        return error
    return None


def for_ranges(kernel: Kernel, count: int, grain: int) -> None:
    """Call `kernel(start, stop)` over [0, count) in ranges of at most `grain`, on all threads of the pool.

    Ranges must not depend on each other. The first exception is raised here after all ranges have ended.
    """
    _run(kernel, count, grain)


def parallel_for_cancellable(
    kernel: Kernel,
    count: int,
    grain: int,
    progress: Callable[[float], object],
    is_canceled: Callable[[], bool],
    label: str,
) -> None:
    """`for_ranges` for long work that is watched and may be stopped.

    Args:
        kernel: called with the ends of ranges of at most `grain` out of `count`, from several threads.
        progress: called with the share done after each range. is_canceled: asked before each.
        label: the work is called, in the error.
    Raises:
        CancelledError: `is_canceled` said so.
    """
    lock, done = threading.Lock(), 0

    def step(start: int, stop: int) -> None:
        nonlocal done
        if is_canceled():
            raise CancelledError(f"{label} was cancelled")
        kernel(start, stop)
        with lock:
            done += stop - start
            progress(done / count)

    for_ranges(step, count, grain)


def map_ordered(work: Callable[[Item], T], items: Sequence[Item], max_concurrent: int) -> Iterator[T]:
    """Call `work` with each item, several at once, and give what it returns in the order of the items.

    Args:
        work: called from several threads. items: independent of each other.
        max_concurrent: what of the results is in memory together, at most.
    """
    step = min(max_concurrent, num_threads())
    for first in range(0, len(items), step):
        batch = items[first : first + step]
        results = dict[int, T]()

        def run_range(start: int, stop: int, batch: Sequence[Item] = batch, results: dict[int, T] = results) -> None:
            results.update({k: work(batch[k]) for k in range(start, stop)})

        for_ranges(run_range, len(batch), 1)
        yield from (results[k] for k in range(len(batch)))


def parallel_for_chunks(kernel: Kernel, count: int, chunks_per_thread: int = _CHUNKS_PER_THREAD) -> None:
    """Call `kernel(start, stop)` over [0, count) in a few even shares for each thread.

    For work of a few milliseconds, where handing out a range costs as much as doing it.

    Args:
        kernel: works on a range. count: of all. chunks_per_thread: more where one may cost much more than another.
    """
    grain = max(1, -(-count // (chunks_per_thread * num_threads())))
    _run(kernel, count, grain)
