"""Threads of kernels: which of them do what is asked for."""

import os
import sys
import threading

import pytest

from relume.parallel import beside_frames, for_ranges, for_shares


def names_of(run):
    found = []
    run(lambda start, stop: found.append((start, stop, threading.current_thread().name)))
    assert sorted((start, stop) for start, stop, _ in found)[0][0] == 0
    assert sum(stop - start for start, stop, _ in found) == 1000
    return {name.rsplit("_", 1)[0] for *_, name in found}


def test_frames_what_follows_them_and_long_work_have_threads_of_their_own(monkeypatch):
    monkeypatch.setenv("RELUME_THREADS", "2")

    def frame(kernel):
        for_shares(kernel, 1000)

    assert names_of(frame) == {"relume-frame"}
    with beside_frames():
        assert names_of(frame) == {"relume-beside"}
    assert names_of(frame) == {"relume-frame"}
    assert names_of(lambda kernel: for_ranges(kernel, 1000, 10)) == {"relume-kernel"}


def test_a_failure_beside_frames_leaves_the_next_frame_as_it_was(monkeypatch):
    monkeypatch.setenv("RELUME_THREADS", "2")

    def fails(start, stop):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), beside_frames():
        for_shares(fails, 1000)
    assert names_of(lambda kernel: for_shares(kernel, 1000)) == {"relume-frame"}


@pytest.mark.skipif(sys.platform != "linux", reason="threads have no niceness of their own elsewhere")
def test_frames_go_first(monkeypatch):
    monkeypatch.setenv("RELUME_THREADS", "2")
    found = []

    def kernel(start, stop):
        found.append(os.getpriority(os.PRIO_PROCESS, 0))

    for_shares(kernel, 1000)
    of_frames = max(found)
    found.clear()
    with beside_frames():
        for_shares(kernel, 1000)
    for_ranges(kernel, 1000, 100)
    assert min(found) > of_frames or of_frames == 19  # there is nothing beyond
