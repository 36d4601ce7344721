"""Has what a new bake shows first made before anybody opens it: its own look, exactly, and its thumbnail.

One server of a data directory does, the one that has the lock of a file in it: what is made lies there, for all.
"""

from __future__ import annotations

import fcntl
import logging
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from relume.code_version import image_code
from relume.errors import CancelledError, NotFoundError, RelumeError
from server.apart.step import RunStep, Step
from server.apart.thumbnails import Thumbnails
from worker.database.faults import Complaint
from worker.ledger import Ledger
from worker.paths import bake_path
from worker.status import MOVING
from worker.storage.locks import open_locked

log = logging.getLogger(__name__)

ROUND_S = 5.0
MOST_AT_START = 20  # an update makes all pictures old
_LOCK = Path("bakes", "locks", "ahead")


class Ahead:
    """Looks for bakes that have become ready, in a thread of its own."""

    def __init__(
        self, data: Path, ledger: Ledger, run: RunStep, thumbnails: Thumbnails, is_used: Callable[[str], bool]
    ) -> None:
        """
        Args:
            data: the data directory. run: does steps.
            is_used: whether somebody has a bake open, who makes its pictures already.
        """
        self._data, self._ledger, self._run_step = data, ledger, run
        self._thumbnails, self._is_used = thumbnails, is_used
        self._closing = threading.Event()
        self._complaint = Complaint(log, "first pictures of new bakes cannot be made")
        self._thread = threading.Thread(target=self._run, name="relume-ahead", daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def close(self) -> None:
        """Stop looking; a step that is under way is not wanted any more."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        known: set[str] = set()
        while not self._closing.wait(ROUND_S):  # who waits for a bake opens it meanwhile
            try:
                with self._turn() as is_ours:
                    if is_ours:
                        self._go_round(known)
                        self._complaint.well()  # where another server has the turn nothing was asked
            except Exception as error:  # the database may be away for a while; the thread must outlive that
                self._complaint.meet(error)

    def _go_round(self, known: set[str]) -> None:
        """Make the pictures of bakes that were not known yet, the newest first; at first, of a few that have none."""
        ready = self._ledger.ready()
        known.intersection_update(ready)  # one that was deleted may be baked again
        new = [bake for bake in ready if bake not in known]
        if not known:
            known.update(new[MOST_AT_START:])
            new = new[:MOST_AT_START]
        for bake in new:
            if self._closing.is_set():
                return
            known.add(bake)
            if self._lacks_pictures(bake):
                self._make(bake)

    def _lacks_pictures(self, bake: str) -> bool:
        """Whether a bake is here, and no picture of its own look by this code."""
        store = bake_path(self._data, bake)
        with suppress(NotFoundError):
            is_fixed = self._ledger.bake(bake).recipe.method not in MOVING
            return is_fixed and store.exists() and not (store / "derived" / image_code()).exists()
        return False

    def _make(self, bake: str) -> None:
        def is_wanted() -> bool:
            return not self._closing.is_set() and not self._is_used(bake)

        if not is_wanted():
            return
        try:
            step = Step("first picture of a bake", values={"bake": bake})
            self._run_step(step, lambda share: None, is_wanted)
            self._thumbnails.paint(bake, is_first=False)
        except CancelledError:  # somebody opened it, or the server closes
            pass
        except (RelumeError, OSError) as error:  # whoever opens it is told; it may have been deleted meanwhile
            log.info("the first picture of bake %s was not made ahead (%s)", bake, error)

    @contextmanager
    def _turn(self) -> Iterator[bool]:
        """Whether it is for this process to look, for as long as the block runs."""
        try:
            lock = open_locked(self._data / _LOCK, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        try:
            yield True
        finally:
            os.close(lock)
