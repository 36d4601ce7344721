"""Who runs a bake, or a step of another work. Several services may share one ledger; a lease keeps each with one
of them.

An owner is named place/process/nonce/number. Its lease ends when it stops renewing it, and at once when it ran in this
place and its process is gone, so that a restart after a crash does not wait. A place is where a process number means
one process: host names alone do not say that, because two machines or containers may have the same.
"""

from __future__ import annotations

import itertools
import logging
import os
import socket
import threading
import uuid
from collections.abc import Callable
from pathlib import Path

from relume_worker.database.failures import DATABASE_ERRORS, DatabaseError

log = logging.getLogger(__name__)

LEASE_S = 15.0
HEARTBEAT_S = 1.0

_NONCE = uuid.uuid4().hex
_numbers = itertools.count()


def _process_location() -> str:
    """The host's name, for people, and what makes it unique: this start of the kernel and the namespace of process
    numbers; the network card's address on systems that say neither."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        namespace = os.readlink("/proc/self/ns/pid")
    except OSError:
        boot, namespace = f"{uuid.getnode():x}", ""
    return f"{socket.gethostname()}:{boot}:{namespace}".replace("/", "-")


_LOCATION = _process_location()


def new_owner() -> str:
    """A name for a service of this process that no other has."""
    return f"{_LOCATION}/{os.getpid()}/{_NONCE}/{next(_numbers)}"


def owner_text(owner: str) -> str:
    """An owner as logs name it: host and process."""
    location, pid, *_ = owner.split("/")
    return f"{location.split(':')[0]}, process {pid}"


def log_taken_over(noun: str, identity: str, previous_owner: str) -> None:
    """Log that this process takes a job over. noun, identity: the job; previous_owner: its last owner."""
    log.warning(
        "%s %s is taken over from %s, which renews its lease no more", noun, identity, owner_text(previous_owner),
        extra={"fields": {noun.lower(): identity}},
    )  # fmt: skip


def log_lost_lease(noun: str, identity: str) -> None:
    """Say that this process was paused, or cut off from the database, for longer than its lease. noun, identity: the
    work that it was at."""
    log.warning(
        "%s %s was taken over by another process while this one stood still: what it was doing here is dropped",
        noun, identity, extra={"fields": {noun.lower(): identity}},
    )  # fmt: skip


def is_alive(owner: str, heartbeat: float, now: float) -> bool:
    """Whether an owner still holds its lease, by what can be known from here.

    Args:
        heartbeat, now: seconds since 1970, of one clock: the database's.
    """
    return now - heartbeat <= LEASE_S and may_run(owner)


def may_run(owner: str) -> bool:
    """Whether an owner is there, as far as can be known from here: of other machines and containers nothing can."""
    location, pid, nonce, _ = owner.split("/")
    if location != _LOCATION:
        return True
    if int(pid) == os.getpid():
        return nonce == _NONCE
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


class LeaseRenewer:
    """Calls `renew` for the lease of a bake or another work while it runs, also through long steps such as the check
    before publishing.

    The work and its owner are those that the ledger knows.
    """

    def __init__(self, renew: Callable[[str, str], object], work_id: str, owner: str) -> None:
        self._renew, self._work_id, self._owner = renew, work_id, owner
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, name="relume-lease", daemon=True)

    def __enter__(self) -> LeaseRenewer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()

    def _run(self) -> None:
        database_error = DatabaseError(log, f"the lease of {self._work_id} cannot be renewed")
        while not self._done.wait(HEARTBEAT_S):
            try:
                self._renew(self._work_id, self._owner)
                database_error.report_recovered()
            except DATABASE_ERRORS as error:  # a database that is away for some seconds costs no lease
                database_error.report_failure(error)
