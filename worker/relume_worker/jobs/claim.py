"""Lease owner of a job's files, written next to them by the service that runs it.

A process that was suspended together with its server does not ask before it continues: it finds here that another
server has taken the job over.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from relume.core.filesystem import atomic_write

_NAME = "claim.txt"
_CHECK_INTERVAL_S = 0.1


def claim(folder: Path, owner: str) -> None:
    """Mark a job's files as owned by a lease owner."""
    if not is_claimed_by(folder, owner):
        with atomic_write(folder / _NAME) as unfinished:
            unfinished.write_text(owner)


def is_claimed_by(folder: Path, owner: str) -> bool:
    """True if the files of a job are neither deleted nor claimed by another owner."""
    try:
        return (folder / _NAME).read_text() == owner
    except OSError:
        return False


def canceled_or_taken_over(folder: Path, owner: str, is_canceled: Callable[[], bool]) -> Callable[[], bool]:
    """Return a check whether to end a step: canceled, or claimed by another owner.

    Args:
        folder: folder of the job. owner: owner of its lease. is_canceled: polled too.
    Returns:
        A function that steps may call thousands of times per second; it reads the file ten times.
    """
    next_s, is_over = 0.0, False

    def is_cancelled() -> bool:
        nonlocal next_s, is_over
        if (now_s := time.monotonic()) >= next_s:
            next_s, is_over = now_s + _CHECK_INTERVAL_S, not is_claimed_by(folder, owner)
        return is_over or is_canceled()

    return is_cancelled
