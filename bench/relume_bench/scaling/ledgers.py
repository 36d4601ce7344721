"""Temporary ledgers: a SQLite file, or a PostgreSQL cluster if its programs are installed."""

from __future__ import annotations

import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

MAX_CONNECTIONS = 600


@dataclass(frozen=True)
class TemporaryLedger:
    """An empty ledger.

    Attributes:
        url: of the database. pid: process of its server; None: it has none.
    """

    url: str
    pid: int | None = None

    def cpu_s(self) -> float:
        """Processor time of the database's server so far, in seconds."""
        return 0.0 if self.pid is None else tree_cpu_s(self.pid)

    def num_connections(self) -> int:
        """Processes that serve one client each; 0 without a server."""
        return 0 if self.pid is None else sum("relume" in _command(pid) for pid in _children(self.pid))


def tree_cpu_s(pid: int) -> float:
    """Processor time of a process, its children, and those that have ended, in seconds."""
    ticks = _ticks(pid, 4) + sum(_ticks(child, 2) for child in _children(pid))
    return ticks / os.sysconf("SC_CLK_TCK")


def _ticks(pid: int, num_fields: int) -> int:
    """First of: user, system, and the same of ended children."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0
    return sum(int(field) for field in fields[11 : 11 + num_fields])


def _children(pid: int) -> list[int]:
    paths = list(Path(f"/proc/{pid}/task").glob("*/children"))
    return [int(child) for path in paths for child in path.read_text().split()]


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


def _find_program(name: str) -> str | None:
    """Path of a program of the newest installed version; Debian installs them outside PATH."""
    versions = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"), key=lambda path: int(path.parts[-3]))
    return str(versions[-1]) if versions else shutil.which(name)


def has_postgresql() -> bool:
    """True if a PostgreSQL server can be started here."""
    return _find_program("initdb") is not None and _find_program("pg_ctl") is not None


@contextmanager
def temporary_ledger(kind: str, folder: Path) -> Iterator[TemporaryLedger]:
    """Make an empty ledger.

    Args:
        kind: "sqlite" or "postgresql". folder: of the SQLite file.
    """
    if kind == "sqlite":
        yield TemporaryLedger(f"sqlite:///{folder / 'relume.db'}")
        return
    with _cluster() as (port, pid):
        yield TemporaryLedger(f"postgresql://relume@127.0.0.1:{port}/postgres", pid)


@contextmanager
def _cluster() -> Iterator[tuple[int, int]]:
    """Start PostgreSQL in a temporary folder; port and process. It syncs to the disk as by default."""
    initdb, ctl = _find_program("initdb"), _find_program("pg_ctl")
    assert initdb is not None
    assert ctl is not None
    user = pwd.getpwnam("postgres" if _has_user("postgres") else "nobody") if os.geteuid() == 0 else None
    uid = None if user is None else user.pw_uid
    folder = Path(tempfile.mkdtemp(prefix="relume-scaling-"))
    if uid is not None:
        os.chown(folder, uid, -1)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
    data, quiet = str(folder / "data"), {"stdout": subprocess.DEVNULL, "stderr": subprocess.STDOUT}
    options = f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories='' -c max_connections="
    stop = [ctl, "-D", data, "-m", "immediate", "stop"]
    start = [ctl, "-D", data, "-w", "-l", str(folder / "log"), "-o", f"{options}{MAX_CONNECTIONS}", "start"]
    try:
        make = [initdb, "-D", data, "-U", "relume", "-A", "trust", "-E", "UTF8", "--no-sync"]
        subprocess.run(make, check=True, user=uid, cwd="/", **quiet)  # type: ignore[call-overload]
        subprocess.run(start, check=True, user=uid, cwd="/", **quiet)  # type: ignore[call-overload]
        yield port, int((folder / "data" / "postmaster.pid").read_text().split()[0])
    finally:
        subprocess.run(stop, check=False, user=uid, cwd="/", **quiet)  # type: ignore[call-overload]
        shutil.rmtree(folder, ignore_errors=True)


def _has_user(name: str) -> bool:
    try:
        pwd.getpwnam(name)
    except KeyError:
        return False
    return True
