"""Leases of bakes and job steps. Several services may share one ledger; a lease assigns each job to one of them.

An owner is named location/process/nonce/number. Its lease expires when it is not renewed, and at once if its location
is this one and its process is gone, so that a restart after a crash does not wait. A location is where process numbers
are unique: host names are not enough, because two machines or containers may share one.
"""

from __future__ import annotations

import itertools
import logging
import os
import socket
import uuid
from pathlib import Path

log = logging.getLogger(__name__)

LEASE_S = 15.0
HEARTBEAT_S = 1.0
RENEW_S = LEASE_S / 5
"""Interval at which a service renews all its leases; between them bakes record their progress."""

_NONCE = uuid.uuid4().hex
_numbers = itertools.count()


def _process_location() -> str:
    """Host name, for people, and its unique part: boot id and process namespace, or the network card's address on
    systems without these.
    """
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        namespace = os.readlink("/proc/self/ns/pid")
    except OSError:
        boot, namespace = f"{uuid.getnode():x}", ""
    return f"{socket.gethostname()}:{boot}:{namespace}".replace("/", "-")


_LOCATION = _process_location()


def new_owner() -> str:
    """Create a unique owner name for a service of this process."""
    return f"{_LOCATION}/{os.getpid()}/{_NONCE}/{next(_numbers)}"


def owner_text(owner: str) -> str:
    """Format an owner for logs: host and process."""
    location, pid, *_ = owner.split("/")
    return f"{location.split(':')[0]}, process {pid}"


def log_taken_over(noun: str, identity: str, previous_owner: str) -> None:
    """Log that this process takes a job over. noun, identity: the job; previous_owner: its last owner."""
    log.warning(
        "%s %s is taken over from %s, which has stopped renewing its lease", noun, identity, owner_text(previous_owner),
        extra={"fields": {noun.lower(): identity}},
    )  # fmt: skip


def log_lost_lease(noun: str, identity: str) -> None:
    """Log that this process was suspended or cut off for longer than its lease. noun, identity: the job."""
    log.warning(
        "%s %s was taken over by another process while this one was suspended: its work here is dropped",
        noun, identity, extra={"fields": {noun.lower(): identity}},
    )  # fmt: skip


def is_alive(owner: str, heartbeat: float, now: float) -> bool:
    """True if an owner still holds its lease, as far as this process can tell.

    Args:
        owner: owner of the lease. heartbeat, now: seconds since 1970 by the database's clock.
    """
    return now - heartbeat <= LEASE_S and may_run(owner)


def may_run(owner: str) -> bool:
    """True if an owner's process may exist; for other machines and containers this is unknown, hence true."""
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
