"""Whose step the files of a work are: the server that holds its lease writes it down beside them.

A process that was paused together with its server asks nobody before it goes on: it finds here that another server has
the work.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from relume.core.filesystem import atomic_write

_NAME = "claim.txt"
_CHECK_INTERVAL_S = 0.1


def claim(folder: Path, owner: str) -> None:
    """Say that a work's files are changed by an owner of a lease alone from now on."""
    if not is_claimed_by(folder, owner):
        with atomic_write(folder / _NAME) as unfinished:
            unfinished.write_text(owner)


def is_claimed_by(folder: Path, owner: str) -> bool:
    """Whether nobody else has the files of a work, nor has deleted them."""
    try:
        return (folder / _NAME).read_text() == owner
    except OSError:
        return False


def cancelled_or_taken_over(folder: Path, owner: str, is_canceled: Callable[[], bool]) -> Callable[[], bool]:
    """Whether a step is to end: it is cancelled, or its files are somebody else's. Steps ask thousands of times a
    second, the file is read ten times."""
    next_s, is_over = 0.0, False

    def is_cancelled() -> bool:
        nonlocal next_s, is_over
        if (now_s := time.monotonic()) >= next_s:
            next_s, is_over = now_s + _CHECK_INTERVAL_S, not is_claimed_by(folder, owner)
        return is_over or is_canceled()

    return is_cancelled
