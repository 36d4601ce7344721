"""Thread pools of kernels: which threads run the work."""

import os
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from relume.core.thread_pools import (
    for_ranges,
    low_priority,
    map_ordered,
    mark_background_thread,
    parallel_for_chunks,
    run_frame,
)


@pytest.fixture(autouse=True)
def two_threads(monkeypatch):
    monkeypatch.setenv("RELUME_THREADS", "2")


def fractions(kernel):
    parallel_for_chunks(kernel, 1000)


def ranges(kernel):
    for_ranges(kernel, 1000, 10)


def names_of(run):
    """Thread pools that do the work, or the caller, each part once."""
    names = []
    run(lambda start, stop: names.append((start, stop, threading.current_thread().name)))
    parts = sorted((start, stop) for start, stop, _ in names)
    assert [start for start, _ in parts] == [0, *(stop for _, stop in parts[:-1])]
    assert parts[-1][1] == 1000
    return {name.rsplit("_", 1)[0] for *_, name in names}


def names_of_meeting_threads():
    """Names of the threads of two ranges that wait for each other, which needs two threads."""
    barrier, names = threading.Barrier(2, timeout=30), set()

    def meet(start, stop):
        barrier.wait()
        names.add(threading.current_thread())

    for_ranges(meet, 2, 1)
    return names


def of_frames():
    """Threads that compute frames: the caller, and others of the pool unless it finished before they woke."""
    return {threading.current_thread().name.rsplit("_", 1)[0], "kernels-frame"}


@pytest.mark.parametrize("run", [fractions, ranges])
def test_frames_follow_ups_and_long_work_have_separate_threads(run):
    assert names_of(run) <= of_frames()
    with low_priority():
        assert names_of(run) == {"kernels-beside"}
    assert names_of(run) <= of_frames()
    with ThreadPoolExecutor(1, initializer=mark_background_thread) as long:
        assert long.submit(names_of, run).result() == {"kernels-long"}

        def follows():
            with low_priority():
                return names_of(run)

        assert long.submit(follows).result() == {"kernels-beside"}
        assert long.submit(names_of, run).result() == {"kernels-long"}


@pytest.mark.parametrize("run", [fractions, ranges])
def test_concurrent_frames_use_separate_threads(run):
    assert len(run_frame(names_of_meeting_threads)) == 2
    barrier = threading.Barrier(2)

    def crowded():
        barrier.wait(30)
        names = names_of(run)
        barrier.wait(30)
        return names

    with ThreadPoolExecutor(2, "hand") as hands:
        futures = [hands.submit(run_frame, crowded) for _ in range(2)]
        assert [names.result() for names in futures] == [{"hand"}, {"hand"}]
    with pytest.raises(ZeroDivisionError):
        run_frame(lambda: 1 / 0)
    assert len(run_frame(names_of_meeting_threads)) == 2


def test_a_failure_does_not_affect_the_next_frame():
    def fails(start, stop):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), low_priority():
        parallel_for_chunks(fails, 1000)
    assert names_of(fractions) <= of_frames()


def test_frames_are_computed_by_the_caller_and_another_thread():
    names = names_of_meeting_threads()
    assert threading.current_thread() in names
    assert len(names) == 2


def test_a_failure_is_raised_when_all_ranges_have_ended():
    ended = []

    def fails(start, stop):
        ended.append(start)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        for_ranges(fails, 1000, 10)
    assert sorted(ended) == list(range(0, 1000, 10))


def test_nested_kernels_do_not_wait():
    names = []
    parallel_for_chunks(
        lambda start, stop: parallel_for_chunks(lambda a, b: names.append((start + a, start + b)), stop - start), 1000
    )
    assert sum(stop - start for start, stop in names) == 1000


@pytest.mark.skipif(sys.platform != "linux", reason="threads have no niceness of their own elsewhere")
def test_frames_have_priority():
    def niceness():
        values = []
        fractions(lambda start, stop: values.append(os.getpriority(os.PRIO_PROCESS, 0)))
        return values

    of_frames = max(niceness())
    with low_priority():
        assert min(niceness()) > of_frames or of_frames == 19  # 19 is the maximum
    with ThreadPoolExecutor(1, initializer=mark_background_thread) as long:
        assert min(long.submit(niceness).result()) > of_frames or of_frames == 19


def test_ordered_results_are_computed_ahead_but_no_more_than_allowed():
    started = []

    def square(k):
        started.append(k)
        time.sleep(0.01 if k % 2 == 0 else 0)  # even ones end after the next odd one
        return k * k

    results = map_ordered(square, range(20), 2)
    for k, result in enumerate(results):
        assert result == k * k
        assert len(started) <= k + 2  # one ahead of the result in use
    assert sorted(started) == list(range(20))
    assert list(map_ordered(square, range(5), 1)) == [0, 1, 4, 9, 16]
    assert list(map_ordered(square, [], 4)) == []


def test_no_work_goes_on_after_an_ordered_map_has_failed_or_is_closed():
    running = []

    def work(k):
        running.append(k)
        time.sleep(0.02)
        running.remove(k)
        if k == 3:
            raise ValueError("three")
        return k

    results = map_ordered(work, range(50), 2)
    with pytest.raises(ValueError, match="three"):
        list(results)
    assert running == []
    results = map_ordered(work, range(50), 2)
    assert next(results) == 0
    results.close()
    assert running == []


def test_ordered_maps_inside_of_kernels_do_not_wait_for_themselves():
    sums = []
    for_ranges(lambda start, stop: sums.append(sum(map_ordered(lambda k: k, range(start, stop), 2))), 100, 10)
    assert sum(sums) == sum(range(100))
