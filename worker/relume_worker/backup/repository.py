"""The folder of backups.

    relume-backup.json      says that it is one
    files/ab/abcd…          contents, each once, named by their SHA-256
    snapshots/<time>.json   what a data directory held at that time; written last, so its presence means "whole"

A backup that is interrupted leaves files that no snapshot names; the next one finds them there.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from relume.core.errors import BackupError
from relume.core.filesystem import UNFINISHED, atomic_write

FORMAT = 1
MARK = "relume-backup.json"
COPIES = ".ledger-"
"""How folders of copies of a ledger begin, while they are made."""
MAX_SNAPSHOT_BYTES = 1 << 30
COPY_BYTES = 1 << 20

_SHA256 = re.compile(r"[0-9a-f]{64}")
_NAME = re.compile(r"\d{8}T\d{6}Z(-\d+)?")

ReportBytes = Callable[[int], None]
"""Told how many bytes were dealt with since the last time; what it raises ends the work."""


@dataclass(frozen=True)
class StoredFile:
    """A file of a snapshot; `path` is below the data directory, `mtime_ns` what it was there."""

    path: str
    num_bytes: int
    sha256: str
    mtime_ns: int

    @property
    def content_key(self) -> str:
        """The bake, scene or other thing that it is a file of: nothing of one is of use without the rest."""
        return "/".join(self.path.split("/")[:2])


@dataclass(frozen=True)
class Snapshot:
    """A data directory at one moment.

    Attributes:
        name: its time, UTC. relume: version that took it. revision: of the ledger. ledger: the copy of it.
        left_out: what should be in it and is not, a sentence each.
    """

    name: str
    relume: str
    revision: str
    ledger: StoredFile
    files: tuple[StoredFile, ...]
    left_out: tuple[str, ...]

    @property
    def all(self) -> tuple[StoredFile, ...]:
        """The ledger, and the files."""
        return self.ledger, *self.files


class BackupRepository:
    """A folder of backups."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def initialize(self) -> None:
        """Make it, or take the one that is there. Raises BackupError where the folder holds something else."""
        if self.is_repository():
            return
        if self.folder.exists() and (not self.folder.is_dir() or any(self.folder.iterdir())):
            raise BackupError(f"{self.folder} holds something else than backups of relume; name an empty folder")
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        for folder_name in ("files", "snapshots"):
            (self.folder / folder_name).mkdir(exist_ok=True)
        with atomic_write(self.folder / MARK) as unfinished:
            unfinished.write_text(json.dumps({"format": FORMAT}))

    def is_repository(self) -> bool:
        """Whether it is a folder of backups. Raises BackupError where a newer relume has made it."""
        try:
            text = (self.folder / MARK).read_text(encoding="utf-8")
        except (FileNotFoundError, NotADirectoryError):
            return False
        if json.loads(text).get("format") != FORMAT:
            raise BackupError(f"{self.folder} is of a newer relume; use that one")
        return True

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Make it or take it, and let no other backup into it meanwhile; what killed ones left half-written goes."""
        self.initialize()
        with (self.folder / MARK).open("rb") as mark:
            try:
                fcntl.flock(mark, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise BackupError(f"another backup into {self.folder} is under way; wait for it") from None
            for leftover in self.folder.rglob(UNFINISHED):
                leftover.unlink(missing_ok=True)
            for leftover in self.folder.glob(f"{COPIES}*"):
                shutil.rmtree(leftover, ignore_errors=True)
            yield

    def content_path(self, sha256: str) -> Path:
        """File of a content."""
        return self.folder / "files" / sha256[:2] / sha256

    def store(self, source: Path, sha256: str, report_bytes: ReportBytes) -> bool:
        """Keep a content.

        Args:
            source: a file that has it. sha256: that it should have. report_bytes: hears of progress.
        Returns:
            Whether it has; else it has changed, or is damaged.
        """
        target = self.content_path(sha256)
        if target.exists():
            report_bytes(target.stat().st_size)
            return True
        target.parent.mkdir(parents=True, exist_ok=True)
        return copy_verified(source, target, sha256, report_bytes)

    def names(self) -> list[str]:
        """Names of the snapshots, oldest first."""
        return sorted(path.stem for path in (self.folder / "snapshots").glob("*.json") if _NAME.fullmatch(path.stem))

    def write(self, snapshot: Snapshot) -> None:
        """Make a snapshot known, all of whose contents are kept."""
        with atomic_write(self.folder / "snapshots" / f"{snapshot.name}.json") as unfinished:
            unfinished.write_text(json.dumps({"format": FORMAT, **asdict(snapshot)}, indent=1))

    def read(self, name: str | None = None) -> Snapshot:
        """A snapshot; the newest where none is named. Raises BackupError."""
        names = self.names() if self.is_repository() else []
        if not names:
            raise BackupError(f"{self.folder} holds no backup; make one with: relume backup {self.folder}")
        name = name or names[-1]
        if name not in names:
            raise BackupError(f"there is no backup {name[:40]!r}; there are {', '.join(names[-10:])}")
        path = self.folder / "snapshots" / f"{name}.json"
        if path.stat().st_size > MAX_SNAPSHOT_BYTES:
            raise BackupError(f"{path.name} has more than {MAX_SNAPSHOT_BYTES:,} bytes; it is not relume's")
        try:
            return _snapshot(json.loads(path.read_text(encoding="utf-8")))
        except (ValueError, KeyError, TypeError) as error:
            raise BackupError(f"{path.name} is not a snapshot of relume ({error}); take another") from error

    def find_damaged(self, snapshot: Snapshot, report_bytes: ReportBytes) -> Iterator[StoredFile]:
        """Files of a snapshot whose contents are missing or are not what they were."""
        for stored_file in snapshot.all:
            path = self.content_path(stored_file.sha256)
            if (
                not path.is_file()
                or path.stat().st_size != stored_file.num_bytes
                or compute_digest(path, report_bytes) != stored_file.sha256
            ):
                yield stored_file

    def quarantine(self, stored_file: StoredFile) -> None:
        """Give a damaged content another name, so that the next backup copies it anew where it still is."""
        path = self.content_path(stored_file.sha256)
        if path.exists():
            path.rename(path.with_name(f"{path.name}.damaged"))


def compute_digest(path: Path, report_bytes: ReportBytes) -> str:
    """SHA-256 of a file."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(COPY_BYTES):
            digest.update(piece)
            report_bytes(len(piece))
    return digest.hexdigest()


def copy_verified(source: Path, target: Path, sha256: str, report_bytes: ReportBytes) -> bool:
    """Copy a file, which takes its name when it is complete.

    Args:
        source: what is copied. target: where to; its folder exists.
        sha256: that it should have. report_bytes: hears of progress.
    Returns:
        Whether it has; else there is no copy.
    """
    digest = hashlib.sha256()
    try:
        with atomic_write(target) as unfinished:
            with source.open("rb") as source_stream, unfinished.open("wb") as target_stream:
                while piece := source_stream.read(COPY_BYTES):
                    digest.update(piece)
                    target_stream.write(piece)
                    report_bytes(len(piece))
            if digest.hexdigest() != sha256:
                raise _ContentMismatchError
    except _ContentMismatchError:
        return False
    return True


class _ContentMismatchError(Exception):
    """A file has another content than it should."""


def _snapshot(document: dict[str, Any]) -> Snapshot:
    if document["format"] != FORMAT:
        raise ValueError("of another format")
    files = tuple(_read_stored_file(entry) for entry in document["files"])
    name, version, revision = (str(document[name]) for name in ("name", "relume", "revision"))
    left_out = tuple(map(str, document["left_out"]))
    return Snapshot(name, version, revision, _read_stored_file(document["ledger"]), files, left_out)


def _read_stored_file(entry: dict[str, Any]) -> StoredFile:
    stored_file = StoredFile(str(entry["path"]), int(entry["num_bytes"]), str(entry["sha256"]), int(entry["mtime_ns"]))
    components = stored_file.path.split("/")
    if (
        not _SHA256.fullmatch(stored_file.sha256)
        or not all(components)
        or {".", ".."} & set(components)
        or "\0" in stored_file.path
    ):
        raise ValueError(f"it names {stored_file.path[:80]!r}")
    return stored_file
