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

from relume.core.errors import CancelledError, NotFoundError, RelumeError
from relume.core.source_hash import image_code
from relume_server.batch.step import RunStep, Step
from relume_server.batch.thumbnails import Thumbnails
from relume_worker.database.failures import DatabaseError
from relume_worker.ledger import Ledger
from relume_worker.paths import bake_path
from relume_worker.status import FREE_CAMERA_METHODS
from relume_worker.storage.locks import open_lock_file

log = logging.getLogger(__name__)

POLL_INTERVAL_S = 5.0
MAX_BAKES_AT_START = 20  # an update makes all pictures old
_LOCK = Path("bakes", "locks", "ahead")


class Prewarmer:
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
        self._outage = DatabaseError(log, "first pictures of new bakes cannot be made")
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
        processed: set[str] = set()
        while not self._closing.wait(POLL_INTERVAL_S):  # who waits for a bake opens it meanwhile
            try:
                with self._try_lock() as has_lock:
                    if has_lock:
                        self._run_once(processed)
                        self._outage.report_recovered()
            except Exception as error:  # the database may be away for a while; the thread must outlive that
                self._outage.report_failure(error)

    def _run_once(self, processed: set[str]) -> None:
        """Make the pictures of bakes that were not known yet, the newest first; at first, of a few that have none."""
        ready_bakes = self._ledger.ready_bakes()
        processed.intersection_update(ready_bakes)  # one that was deleted may be baked again
        new = [bake for bake in ready_bakes if bake not in processed]
        if not processed:
            processed.update(new[MAX_BAKES_AT_START:])
            new = new[:MAX_BAKES_AT_START]
        for bake in new:
            if self._closing.is_set():
                return
            processed.add(bake)
            if self._needs_pictures(bake):
                self._prewarm(bake)

    def _needs_pictures(self, bake: str) -> bool:
        """Whether a bake is here, and no picture of its own look by this code."""
        store = bake_path(self._data, bake)
        with suppress(NotFoundError):
            is_fixed = self._ledger.bake(bake).recipe.method not in FREE_CAMERA_METHODS
            return is_fixed and store.exists() and not (store / "derived" / image_code()).exists()
        return False

    def _prewarm(self, bake: str) -> None:
        def is_needed() -> bool:
            return not self._closing.is_set() and not self._is_used(bake)

        if not is_needed():
            return
        try:
            step = Step("first picture of a bake", values={"bake": bake})
            self._run_step(step, lambda share: None, is_needed)
            self._thumbnails.paint(bake, is_first=False)
        except CancelledError:  # somebody opened it, or the server closes
            pass
        except (RelumeError, OSError) as error:  # whoever opens it is told; it may have been deleted meanwhile
            log.info("the first picture of bake %s was not made ahead (%s)", bake, error)

    @contextmanager
    def _try_lock(self) -> Iterator[bool]:
        """Whether it is for this process to look, for as long as the block runs."""
        try:
            lock = open_lock_file(self._data / _LOCK, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        try:
            yield True
        finally:
            os.close(lock)
