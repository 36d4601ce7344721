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

from relume.errors import BackupError
from relume.replacing import UNFINISHED, replacing

FORMAT = 1
MARK = "relume-backup.json"
COPIES = ".ledger-"
"""How folders of copies of a ledger begin, while they are made."""
MAX_SNAPSHOT_BYTES = 1 << 30
COPY_BYTES = 1 << 20

_SHA256 = re.compile(r"[0-9a-f]{64}")
_NAME = re.compile(r"\d{8}T\d{6}Z(-\d+)?")

Tell = Callable[[int], None]
"""Told how many bytes were dealt with since the last time; what it raises ends the work."""


@dataclass(frozen=True)
class Kept:
    """A file of a snapshot; `path` is below the data directory, `mtime_ns` what it was there."""

    path: str
    num_bytes: int
    sha256: str
    mtime_ns: int

    @property
    def thing(self) -> str:
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
    ledger: Kept
    files: tuple[Kept, ...]
    left_out: tuple[str, ...]

    @property
    def all(self) -> tuple[Kept, ...]:
        """The ledger, and the files."""
        return self.ledger, *self.files


class Shelf:
    """A folder of backups."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def begin(self) -> None:
        """Make it, or take the one that is there. Raises BackupError where the folder holds something else."""
        if self.is_one():
            return
        if self.folder.exists() and (not self.folder.is_dir() or any(self.folder.iterdir())):
            raise BackupError(f"{self.folder} holds something else than backups of relume; name an empty folder")
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        for part in ("files", "snapshots"):
            (self.folder / part).mkdir(exist_ok=True)
        with replacing(self.folder / MARK) as unfinished:
            unfinished.write_text(json.dumps({"format": FORMAT}))

    def is_one(self) -> bool:
        """Whether it is a folder of backups. Raises BackupError where a newer relume has made it."""
        try:
            text = (self.folder / MARK).read_text(encoding="utf-8")
        except (FileNotFoundError, NotADirectoryError):
            return False
        if json.loads(text).get("format") != FORMAT:
            raise BackupError(f"{self.folder} is of a newer relume; use that one")
        return True

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Make it or take it, and let no other backup into it meanwhile; what killed ones left half-written goes."""
        self.begin()
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

    def path_of(self, sha256: str) -> Path:
        """File of a content."""
        return self.folder / "files" / sha256[:2] / sha256

    def keep(self, source: Path, sha256: str, tell: Tell) -> bool:
        """Keep a content.

        Args:
            source: a file that has it. sha256: that it should have. tell: hears of progress.
        Returns:
            Whether it has; else it has changed, or is damaged.
        """
        target = self.path_of(sha256)
        if target.exists():
            tell(target.stat().st_size)
            return True
        target.parent.mkdir(parents=True, exist_ok=True)
        return copy_verified(source, target, sha256, tell)

    def names(self) -> list[str]:
        """Names of the snapshots, oldest first."""
        return sorted(path.stem for path in (self.folder / "snapshots").glob("*.json") if _NAME.fullmatch(path.stem))

    def write(self, snapshot: Snapshot) -> None:
        """Make a snapshot known, all of whose contents are kept."""
        with replacing(self.folder / "snapshots" / f"{snapshot.name}.json") as unfinished:
            unfinished.write_text(json.dumps({"format": FORMAT, **asdict(snapshot)}, indent=1))

    def read(self, name: str | None = None) -> Snapshot:
        """A snapshot; the newest where none is named. Raises BackupError."""
        names = self.names() if self.is_one() else []
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

    def damaged(self, snapshot: Snapshot, tell: Tell) -> Iterator[Kept]:
        """Files of a snapshot whose contents are missing or are not what they were."""
        for kept in snapshot.all:
            path = self.path_of(kept.sha256)
            if not path.is_file() or path.stat().st_size != kept.num_bytes or digest_of(path, tell) != kept.sha256:
                yield kept

    def set_aside(self, kept: Kept) -> None:
        """Give a damaged content another name, so that the next backup copies it anew where it still is."""
        path = self.path_of(kept.sha256)
        if path.exists():
            path.rename(path.with_name(f"{path.name}.damaged"))


def digest_of(path: Path, tell: Tell) -> str:
    """SHA-256 of a file."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while piece := file.read(COPY_BYTES):
            digest.update(piece)
            tell(len(piece))
    return digest.hexdigest()


def copy_verified(source: Path, target: Path, sha256: str, tell: Tell) -> bool:
    """Copy a file, which takes its name when it is complete.

    Args:
        source: what is copied. target: where to; its folder exists.
        sha256: that it should have. tell: hears of progress.
    Returns:
        Whether it has; else there is no copy.
    """
    digest = hashlib.sha256()
    try:
        with replacing(target) as unfinished:
            with source.open("rb") as reading, unfinished.open("wb") as writing:
                while piece := reading.read(COPY_BYTES):
                    digest.update(piece)
                    writing.write(piece)
                    tell(len(piece))
            if digest.hexdigest() != sha256:
                raise _OtherContentError
    except _OtherContentError:
        return False
    return True


class _OtherContentError(Exception):
    """A file has another content than it should."""


def _snapshot(document: dict[str, Any]) -> Snapshot:
    if document["format"] != FORMAT:
        raise ValueError("of another format")
    files = tuple(_kept(entry) for entry in document["files"])
    name, version, revision = (str(document[name]) for name in ("name", "relume", "revision"))
    left_out = tuple(map(str, document["left_out"]))
    return Snapshot(name, version, revision, _kept(document["ledger"]), files, left_out)


def _kept(entry: dict[str, Any]) -> Kept:
    kept = Kept(str(entry["path"]), int(entry["num_bytes"]), str(entry["sha256"]), int(entry["mtime_ns"]))
    parts = kept.path.split("/")
    if not _SHA256.fullmatch(kept.sha256) or not all(parts) or {".", ".."} & set(parts) or "\0" in kept.path:
        raise ValueError(f"it names {kept.path[:80]!r}")
    return kept
