"""Thread pools for all kernels of this process: for frames, for work that follows a frame, and for long work.

Kernels release the GIL and work on ranges. Only this module splits work, so that nested threads never compete for the
same cores. A precomputation submits hundreds of ranges at once, and the few ranges of a frame must not queue behind
them: the calling thread decides which pool works, and the system gives frames most of a contended core. When as many
frames are computed at once as there are threads, each uses its own thread: splitting and waiting would only cost time.
`RELUME_THREADS` bounds each pool; worker processes set it to 1, and use `all_cores` for work that somebody waits for.
"""

from __future__ import annotations

import os
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from typing import ParamSpec, TypeVar

from relume.core.errors import CancelledError

P = ParamSpec("P")
T = TypeVar("T")
Item = TypeVar("Item")
Kernel = Callable[[int, int], object]
"""Processes a range [start, stop)."""

# two chunks per thread balance a core that is busy with other work; more chunks cost more than they save
_CHUNKS_PER_THREAD = 2

# queried once: in an edit's frame of 3 ms, a query in every kernel took 1 ms
_AVAILABLE = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

_FRAME, _LOW_PRIORITY, _LONG = "frame", "beside", "long"
# on a contended core, frames get three quarters of the time against long work and nearly all of it against low-priority
# work, which uses at most half of the cores: with both of two cores in use, an edit's frame of 4 ms took 5 ms
_NICE = {_FRAME: 0, _LOW_PRIORITY: 19, _LONG: 5}

_lock = threading.Lock()
_thread_state = threading.local()  # pool: of its kernels. is_of_pool: a pool's thread. has_all_cores: see below
_pools: dict[str, ThreadPoolExecutor] = {}
_frame_threads: list[int] = []  # threads that compute frames now


def num_threads() -> int:
    """Number of ranges of this thread that run at once: `RELUME_THREADS`, or the cores available to this process."""
    if getattr(_thread_state, "has_all_cores", False):
        return _AVAILABLE
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
    if _NICE[name] and sys.platform == "linux":  # elsewhere the priority applies to the whole process
        with suppress(OSError):  # not permitted
            os.setpriority(os.PRIO_PROCESS, 0, os.getpriority(os.PRIO_PROCESS, 0) + _NICE[name])


def mark_background_thread() -> None:
    """Run later kernels of this thread in the pool for long work, which yields to frames."""
    _thread_state.pool = _LONG


@contextmanager
def low_priority() -> Iterator[None]:
    """Context in which this thread's kernels yield to frames and do not queue behind long work."""
    before = getattr(_thread_state, "pool", _FRAME)
    _thread_state.pool = _LOW_PRIORITY
    try:
        yield
    finally:
        _thread_state.pool = before


@contextmanager
def all_cores() -> Iterator[None]:
    """Context in which this thread's kernels use all cores, whatever `RELUME_THREADS` is."""
    _thread_state.has_all_cores = True
    try:
        yield
    finally:
        _thread_state.has_all_cores = False


def run_frame(work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Compute a frame in this thread; while many threads do, each keeps to its own core.

    Args:
        work: called with args and kwargs.
    Returns:
        The result of `work`.
    """
    _frame_threads.append(threading.get_ident())
    try:
        return work(*args, **kwargs)
    finally:
        _frame_threads.remove(threading.get_ident())


def _shared_pool() -> str | None:
    """Return the pool that shares this thread's work; None if it must work alone.

    A pool's thread would wait for itself, and splitting is in vain while every core already computes a frame.
    """
    if getattr(_thread_state, "is_of_pool", False) or num_threads() == 1:
        return None
    pool: str = getattr(_thread_state, "pool", _FRAME)
    is_crowded = pool == _FRAME and len(_frame_threads) >= 2 and len(_frame_threads) >= num_threads()
    return None if is_crowded else pool


def _run(kernel: Kernel, count: int, grain: int) -> None:
    ranges = [(start, min(start + grain, count)) for start in range(0, count, grain)]
    name = _shared_pool()
    if name is None or len(ranges) == 1:
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
    """Process ranges with threads of the pool; each free thread takes the next range.

    The caller works too: waiting threads wake up late, which took a quarter of a frame of 3 ms.
    """
    remaining = iter(ranges)  # the GIL gives each next() to one thread

    def work() -> list[BaseException]:
        return [error for start, stop in remaining if (error := _capture_error(kernel, start, stop)) is not None]

    futures = [_pool(_FRAME).submit(work) for _ in range(min(num_threads(), len(ranges)) - 1)]
    errors = work()
    for future in futures:
        if not future.cancel():  # a canceled future would have found no range left
            errors += future.result()
    if errors:
        raise errors[0]


def _capture_error(kernel: Kernel, start: int, stop: int) -> BaseException | None:
    try:
        kernel(start, stop)
    except BaseException as error:  # raised by the caller after all ranges have ended
        return error
    return None


def for_ranges(kernel: Kernel, count: int, grain: int) -> None:
    """Call `kernel(start, stop)` over [0, count) in ranges of at most `grain`, on all threads of the pool.

    Ranges must be independent. The first exception is raised here after all ranges have ended.
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
    """Cancellable `for_ranges` with progress, for long work.

    Args:
        kernel: called with ranges of at most `grain` out of `count`, from several threads.
        progress: called with the finished fraction after each range. is_canceled: called before each.
        label: name of the work in the error.
    Raises:
        CancelledError: `is_canceled` returned true.
    """
    lock, done = threading.Lock(), 0

    def step(start: int, stop: int) -> None:
        nonlocal done
        if is_canceled():
            raise CancelledError(f"{label} was canceled")
        kernel(start, stop)
        with lock:
            done += stop - start
            progress(done / count)

    for_ranges(step, count, grain)


def map_ordered(work: Callable[[Item], T], items: Sequence[Item], max_concurrent: int) -> Generator[T, None, None]:
    """Call `work` with each item, several at once, and yield the results in the order of the items.

    While the caller uses a result, threads compute the next ones. All calls have ended when the iterator is closed.

    Args:
        work: called from several threads. items: independent of each other.
        max_concurrent: maximum number of results in memory.
    """
    name = _shared_pool()
    if name is None or max_concurrent == 1:
        yield from map(work, items)
        return
    futures = deque[Future[T]]()
    try:
        for item in items:
            if len(futures) == max_concurrent:
                yield futures.popleft().result()
            futures.append(_pool(name).submit(work, item))
        while futures:
            yield futures.popleft().result()
    finally:
        for future in futures:
            future.cancel()
        wait(futures)


def parallel_for_chunks(kernel: Kernel, count: int, chunks_per_thread: int = _CHUNKS_PER_THREAD) -> None:
    """Call `kernel(start, stop)` over [0, count) in a few equal chunks for each thread.

    For work of a few milliseconds, where scheduling a range costs as much as running it.

    Args:
        kernel: processes a range. count: number of items. chunks_per_thread: more if the cost of items varies.
    """
    grain = max(1, -(-count // (chunks_per_thread * num_threads())))
    _run(kernel, count, grain)
