"""A PostgreSQL server in a temporary folder, if its programs are installed."""

from __future__ import annotations

import os
import pwd
import shutil
import socket
import subprocess
import tempfile
import uuid
from collections.abc import Sequence
from pathlib import Path

import pg8000
import pytest
from sqlalchemy.exc import OperationalError

MISSING = "PostgreSQL is not installed (Debian: apt-get install --no-install-recommends postgresql)"
USER = "relume"
REQUIRED_BYTES = 2 << 30  # 8 MB per database, in all test processes


def _program(name: str) -> str | None:
    """Path of a program of the newest installed version; Debian installs them outside PATH."""
    versions = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"), key=lambda path: int(path.parts[-3]))
    return str(versions[-1]) if versions else shutil.which(name)


class Cluster:
    """A temporary cluster that listens on a local port and can be stopped and started repeatedly."""

    def __init__(self) -> None:
        self._initdb, self._ctl = _program("initdb"), _program("pg_ctl")
        if self._initdb is None or self._ctl is None:
            pytest.skip(MISSING)
        self._user = _find_unprivileged_user() if os.geteuid() == 0 else None  # PostgreSQL does not run as root
        self._folder = Path(tempfile.mkdtemp(prefix="relume-postgresql-", dir=_find_ram_folder()))
        with socket.create_server(("127.0.0.1", 0)) as free:
            self._port = free.getsockname()[1]
        if self._user is not None:
            os.chown(self._folder, self._user.pw_uid, self._user.pw_gid)
        self._run([self._initdb, "-D", str(self._data), "-U", USER, "-A", "trust", "-E", "UTF8", "--no-sync"])
        self.start()

    @property
    def _data(self) -> Path:
        return self._folder / "data"

    def start(self) -> None:
        """Start the server and wait until it answers."""
        options = f"-p {self._port} -c listen_addresses=127.0.0.1 -c unix_socket_directories='' -c fsync=off"
        self._run(
            [str(self._ctl), "-D", str(self._data), "-w", "-l", str(self._folder / "log"), "-o", options, "start"]
        )

    def stop(self) -> None:
        """Stop the server like a restart: open connections are closed."""
        self._run([str(self._ctl), "-D", str(self._data), "-w", "-m", "fast", "stop"])

    def new_database(self, like: str | None = None) -> str:
        """Return the URL of an empty database, or of a copy of the one at a URL, which must have no connections."""
        name = f"test_{uuid.uuid4().hex}"
        with pg8000.connect(USER, host="127.0.0.1", port=self._port, database="postgres") as connection:
            connection.autocommit = True
            connection.run(f"CREATE DATABASE {name}" + (f" TEMPLATE {like.rpartition('/')[2]}" if like else ""))
        return f"postgresql://{USER}@127.0.0.1:{self._port}/{name}"

    def remove(self) -> None:
        """Stop the server and delete its files."""
        self._run([str(self._ctl), "-D", str(self._data), "-m", "immediate", "stop"])
        shutil.rmtree(self._folder, ignore_errors=True)

    def _run(self, command: Sequence[str]) -> None:
        uid = self._user.pw_uid if self._user is not None else None
        subprocess.run(command, check=True, user=uid, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT, cwd="/")


def _find_ram_folder() -> str | None:
    """A folder in memory with enough space, or None: a database has 300 files, and deleting those of a test file took
    half a minute on a busy disk.
    """
    shared = "/dev/shm"
    has_room = os.access(shared, os.W_OK) and shutil.disk_usage(shared).free > REQUIRED_BYTES
    return shared if has_room else None


def _find_unprivileged_user() -> pwd.struct_passwd:
    """A user that is not root."""
    for name in ("postgres", "nobody"):
        try:
            return pwd.getpwnam(name)
        except KeyError:
            continue
    pytest.skip("PostgreSQL does not run as root, and there is no user postgres or nobody")


def make_unavailable_error(line: str) -> OperationalError:
    """The error of a call on a server that does not answer. line: the driver's message."""
    return OperationalError(None, None, pg8000.InterfaceError(line))
