"""The backup folder.

    relume-backup.json      marks the folder as one
    files/ab/abcd…          contents, each once, named by their SHA-256
    snapshots/<time>.json   files of a data directory at that time; written last, so it exists only if complete

An interrupted backup leaves contents without a snapshot; the next backup reuses them.
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
"""Prefix of temporary folders with copies of a ledger."""
MAX_SNAPSHOT_BYTES = 1 << 30
COPY_BYTES = 1 << 20

_SHA256 = re.compile(r"[0-9a-f]{64}")
_NAME = re.compile(r"\d{8}T\d{6}Z(-\d+)?")

ReportBytes = Callable[[int], None]
"""Progress callback with the number of bytes since the last call; its exceptions stop the work."""


@dataclass(frozen=True)
class StoredFile:
    """A file of a snapshot; `path` is below the data directory, `mtime_ns` from there."""

    path: str
    num_bytes: int
    sha256: str
    mtime_ns: int

    @property
    def content_key(self) -> str:
        """The bake, scene or other object of the file, which is useless if one of its files is missing."""
        return "/".join(self.path.split("/")[:2])


@dataclass(frozen=True)
class Snapshot:
    """A data directory at one moment.

    Attributes:
        name: time, UTC. relume: version that made it. revision: revision of the ledger. ledger: copy of the ledger.
        left_out: one sentence for each file that is missing.
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
    """A backup folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def initialize(self) -> None:
        """Create the folder, or check an existing one. Raises BackupError if it contains something else."""
        if self.is_repository():
            return
        if self.folder.exists() and (not self.folder.is_dir() or any(self.folder.iterdir())):
            raise BackupError(f"{self.folder} contains something other than relume backups; give an empty folder")
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        for folder_name in ("files", "snapshots"):
            (self.folder / folder_name).mkdir(exist_ok=True)
        with atomic_write(self.folder / MARK) as unfinished:
            unfinished.write_text(json.dumps({"format": FORMAT}))

    def is_repository(self) -> bool:
        """True if it is a backup folder. Raises BackupError if a newer relume made it."""
        try:
            text = (self.folder / MARK).read_text(encoding="utf-8")
        except (FileNotFoundError, NotADirectoryError):
            return False
        if json.loads(text).get("format") != FORMAT:
            raise BackupError(f"{self.folder} was made by a newer relume; use that version")
        return True

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Create or open the folder, lock it for other backups, and delete temporary files of killed ones."""
        self.initialize()
        with (self.folder / MARK).open("rb") as mark:
            try:
                fcntl.flock(mark, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise BackupError(f"another backup into {self.folder} is running; wait for it") from None
            for leftover in self.folder.rglob(UNFINISHED):
                leftover.unlink(missing_ok=True)
            for leftover in self.folder.glob(f"{COPIES}*"):
                shutil.rmtree(leftover, ignore_errors=True)
            yield

    def content_path(self, sha256: str) -> Path:
        """File of a content."""
        return self.folder / "files" / sha256[:2] / sha256

    def store(self, source: Path, sha256: str, report_bytes: ReportBytes) -> bool:
        """Store a content.

        Args:
            source: file with the content. sha256: expected digest. report_bytes: reports progress.
        Returns:
            True if the digest is correct; otherwise the file has changed or is damaged.
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
        """Write a snapshot after all its contents."""
        with atomic_write(self.folder / "snapshots" / f"{snapshot.name}.json") as unfinished:
            unfinished.write_text(json.dumps({"format": FORMAT, **asdict(snapshot)}, indent=1))

    def read(self, name: str | None = None) -> Snapshot:
        """Read a snapshot, by default the newest. Raises BackupError."""
        names = self.names() if self.is_repository() else []
        if not names:
            raise BackupError(f"{self.folder} contains no backup; make one with: relume backup {self.folder}")
        name = name or names[-1]
        if name not in names:
            raise BackupError(f"there is no backup {name[:40]!r}; choose from {', '.join(names[-10:])}")
        path = self.folder / "snapshots" / f"{name}.json"
        if path.stat().st_size > MAX_SNAPSHOT_BYTES:
            raise BackupError(f"{path.name} has more than {MAX_SNAPSHOT_BYTES:,} bytes; it is not relume's")
        try:
            return _snapshot(json.loads(path.read_text(encoding="utf-8")))
        except (ValueError, KeyError, TypeError) as error:
            raise BackupError(f"{path.name} is not a snapshot of relume ({error}); give another") from error

    def find_damaged(self, snapshot: Snapshot, report_bytes: ReportBytes) -> Iterator[StoredFile]:
        """Yield files of a snapshot whose contents are missing or damaged."""
        for stored_file in snapshot.all:
            path = self.content_path(stored_file.sha256)
            if (
                not path.is_file()
                or path.stat().st_size != stored_file.num_bytes
                or compute_digest(path, report_bytes) != stored_file.sha256
            ):
                yield stored_file

    def quarantine(self, stored_file: StoredFile) -> None:
        """Rename a damaged content, so that the next backup copies it again."""
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
    """Copy a file, which gets its name when it is complete.

    Args:
        source: file to copy. target: path in an existing folder.
        sha256: expected digest. report_bytes: reports progress.
    Returns:
        True if the digest is correct; otherwise there is no copy.
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
    """The content of a file is not the expected one."""


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
        raise ValueError(f"its path is {stored_file.path[:80]!r}")
    return stored_file
