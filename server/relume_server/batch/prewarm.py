"""Render the first images of new bakes in advance: the default look, exactly, and the thumbnail.

One server per data directory does it, the one with the lock of a file in it: the results are shared there.
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
from relume_server.batch.thumbnails import Thumbnails
from relume_worker.database.failures import DatabaseError
from relume_worker.jobs.step import RunStep, Step
from relume_worker.ledger import Ledger
from relume_worker.paths import bake_path
from relume_worker.status import FREE_CAMERA_METHODS
from relume_worker.storage.locks import open_lock_file

log = logging.getLogger(__name__)

POLL_INTERVAL_S = 5.0
MAX_BAKES_AT_START = 20  # an update invalidates all images
_LOCK = Path("bakes", "locks", "ahead")


class Prewarmer:
    """Finds bakes that have become ready, in a thread of its own."""

    def __init__(
        self, data: Path, ledger: Ledger, run: RunStep, thumbnails: Thumbnails, is_used: Callable[[str], bool]
    ) -> None:
        """
        Args:
            data: data directory. ledger: ledger of bakes. run: runs steps. thumbnails: thumbnails of bakes.
            is_used: true if a bake is open, so that its images are rendered anyway.
        """
        self._data, self._ledger, self._run_step = data, ledger, run
        self._thumbnails, self._is_used = thumbnails, is_used
        self._closing = threading.Event()
        self._outage = DatabaseError(log, "first images of new bakes cannot be rendered")
        self._thread = threading.Thread(target=self._run, name="relume-ahead", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stop the thread; a running step is canceled."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        processed: set[str] = set()
        while not self._closing.wait(POLL_INTERVAL_S):  # a waiting user opens the bake meanwhile
            try:
                with self._try_lock() as has_lock:
                    if has_lock:
                        self._run_once(processed)
                        self._outage.report_recovered()
            except Exception as error:  # the thread must survive an unavailable database
                self._outage.report_failure(error)

    def _run_once(self, processed: set[str]) -> None:
        """Render images of new bakes, newest first; at startup, of a few that have none."""
        ready_bakes = self._ledger.ready_bakes()
        processed.intersection_update(ready_bakes)  # a deleted one may be baked again
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
        """True if a bake is here without images of its default look by this code version."""
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
            step = Step("first image of a bake", values={"bake": bake})
            self._run_step(step, lambda share: None, is_needed)
            self._thumbnails.paint(bake, is_first=False)
        except CancelledError:  # the bake was opened, or the server is closing
            pass
        except (RelumeError, OSError) as error:  # users who open it get the error; the bake may have been deleted
            log.info("the first image of bake %s was not rendered in advance (%s)", bake, error)

    @contextmanager
    def _try_lock(self) -> Iterator[bool]:
        """Yield true if this process has the lock inside the block."""
        try:
            lock = open_lock_file(self._data / _LOCK, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        try:
            yield True
        finally:
            os.close(lock)
