"""Threads of kernels: which of them do what is asked for."""

import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from relume.core.thread_pools import for_ranges, low_priority, mark_background_thread, parallel_for_chunks, run_frame


@pytest.fixture(autouse=True)
def two_threads(monkeypatch):
    monkeypatch.setenv("RELUME_THREADS", "2")


def shares(kernel):
    parallel_for_chunks(kernel, 1000)


def ranges(kernel):
    for_ranges(kernel, 1000, 10)


def names_of(run):
    """Of the pools that work, or the caller, each part once."""
    found = []
    run(lambda start, stop: found.append((start, stop, threading.current_thread().name)))
    parts = sorted((start, stop) for start, stop, _ in found)
    assert [start for start, _ in parts] == [0, *(stop for _, stop in parts[:-1])]
    assert parts[-1][1] == 1000
    return {name.rsplit("_", 1)[0] for *_, name in found}


def who_meet():
    """Threads of two ranges, of which each waits for the other: one thread alone would wait in vain."""
    both, found = threading.Barrier(2, timeout=30), set()

    def meet(start, stop):
        both.wait()
        found.add(threading.current_thread())

    for_ranges(meet, 2, 1)
    return found


def of_frames():
    """Who makes frames: the caller, and the pool's other threads unless it was done before they woke."""
    return {threading.current_thread().name.rsplit("_", 1)[0], "kernels-frame"}


@pytest.mark.parametrize("run", [shares, ranges])
def test_frames_what_follows_them_and_long_work_have_threads_of_their_own(run):
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


@pytest.mark.parametrize("run", [shares, ranges])
def test_frames_that_are_made_at_once_keep_to_their_own_threads(run):
    assert len(run_frame(who_meet)) == 2
    both = threading.Barrier(2)

    def crowded():
        both.wait(30)
        found = names_of(run)
        both.wait(30)
        return found

    with ThreadPoolExecutor(2, "hand") as hands:
        found = [hands.submit(run_frame, crowded) for _ in range(2)]
        assert [names.result() for names in found] == [{"hand"}, {"hand"}]
    with pytest.raises(ZeroDivisionError):
        run_frame(lambda: 1 / 0)
    assert len(run_frame(who_meet)) == 2


def test_a_failure_beside_frames_leaves_the_next_frame_as_it_was():
    def fails(start, stop):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), low_priority():
        parallel_for_chunks(fails, 1000)
    assert names_of(shares) <= of_frames()


def test_frames_are_made_by_the_caller_and_another():
    found = who_meet()
    assert threading.current_thread() in found
    assert len(found) == 2


def test_a_failure_is_raised_when_all_ranges_have_ended():
    found = []

    def fails(start, stop):
        found.append(start)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        for_ranges(fails, 1000, 10)
    assert sorted(found) == list(range(0, 1000, 10))


def test_kernels_within_kernels_wait_for_nobody():
    found = []
    parallel_for_chunks(
        lambda start, stop: parallel_for_chunks(lambda a, b: found.append((start + a, start + b)), stop - start), 1000
    )
    assert sum(stop - start for start, stop in found) == 1000


@pytest.mark.skipif(sys.platform != "linux", reason="threads have no niceness of their own elsewhere")
def test_frames_go_first():
    def niceness():
        found = []
        shares(lambda start, stop: found.append(os.getpriority(os.PRIO_PROCESS, 0)))
        return found

    of_frames = max(niceness())
    with low_priority():
        assert min(niceness()) > of_frames or of_frames == 19  # there is nothing beyond
    with ThreadPoolExecutor(1, initializer=mark_background_thread) as long:
        assert min(long.submit(niceness).result()) > of_frames or of_frames == 19
