"""Stores of imported assets: one folder each, named by the hash of the imported file.

    <folder>/<id>/<record>    JSON: format, id, name, time of import, and fields of the kind
                  …           files of the kind

Looks refer to an asset as "<prefix><id>"; no other string becomes part of a path. Equal names mean equal content in
every folder, so a process searches all folders that it is configured with.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from relume.core.errors import NotFoundError, ParameterError, RelumeError
from relume.core.filesystem import UNFINISHED, atomic_write, remove_folder

log = logging.getLogger(__name__)

FORMAT_VERSION = 1
MAX_JSON_BYTES = 1 << 20
ID_DIGITS = 16
_ID = re.compile(rf"[0-9a-f]{{{ID_DIGITS}}}")


class AssetRecord(Protocol):
    """Common fields of all records."""

    @property
    def name(self) -> str: ...
    @property
    def created(self) -> float: ...


Entry = TypeVar("Entry", bound=AssetRecord)


def check_name(name: str) -> str:
    """Strip a name that a user chose. Raises ParameterError unless it has 1 to 80 printable characters."""
    name = name.strip()
    if not name.isprintable() or not 1 <= len(name) <= 80:
        raise ParameterError("name", name, "1 to 80 printable characters")
    return name


def _digest(source: Path) -> str:
    with source.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class AssetStore:
    """The store of one kind of assets.

    Attributes:
        label: label of the kind, in messages. prefix: prefix of names in looks. record: name of the JSON file.
        problem: raised if an asset is damaged or the store is full.
        max_entries: maximum number of entries of a folder.
    """

    label: str
    prefix: str
    record: str
    problem: type[RelumeError]
    max_entries: int
    _folders: list[Path] = field(default_factory=list)

    def add_search_folder(self, folder: Path) -> None:
        """Also search this folder from now on; it need not exist yet."""
        self._folders.append(folder)

    @contextmanager
    def with_search_folder(self, folder: Path) -> Iterator[Path]:
        """Also search this folder within the `with` block."""
        self.add_search_folder(folder)
        try:
            yield folder
        finally:
            self._folders.remove(folder)

    @staticmethod
    def content_id(source: Path) -> str:
        """The id of a file's content."""
        return _digest(source)[:ID_DIGITS]

    def name_of(self, content: bytes) -> str:
        """The name in looks of an asset from a file with this content."""
        return self.prefix + hashlib.sha256(content).hexdigest()[:ID_DIGITS]

    def store(self, folder: Path, source: Path, name: str, fill: Callable[[Path], dict[str, Any]]) -> str:
        """Store an asset under the hash of its file, and return its id; an existing asset gets the new name.

        Args:
            folder: folder of the store. source: the file.
            name: shown to users.
            fill: writes the kind's files into an empty folder, and returns the kind's fields of the record.
        Raises:
            self.problem: the store is full, or the id belongs to another file. If `fill` raises, nothing is stored.
        """
        digest = _digest(source)
        identity = digest[:ID_DIGITS]
        target = folder / identity
        if not target.exists():
            self._check_capacity(folder)
            self._create(folder, target, name, lambda staged_folder: {"sha256": digest, **fill(staged_folder)})
        self._set_name(target, name, digest)
        return identity

    def adopt(self, folder: Path, staged_folder: Path) -> None:
        """Move an asset from a staging folder on the same disk into the store; an existing asset gets its name.

        Args:
            folder: folder of the store. staged_folder: the asset's own folder.
        Raises:
            self.problem: the store is full, the asset is damaged, or the id belongs to another file.
        """
        record, target = self.load_record(staged_folder), folder / staged_folder.name
        if not target.exists():
            self._check_capacity(folder)
            folder.mkdir(parents=True, exist_ok=True)
            _move_into_place(staged_folder, target)
        self._set_name(target, record["name"], record.get("sha256"))

    def _check_capacity(self, folder: Path) -> None:
        if len(self.paths(folder)) >= self.max_entries:
            raise self.problem(f"the store has {self.max_entries} {self.label}s, its limit; delete one first")

    def _set_name(self, target: Path, name: str, digest: str | None) -> None:
        """Rename an existing asset, after checking that it came from the same file."""
        document = self.load_record(target)
        if document.get("sha256", digest) != digest:  # a deliberate collision of 64-bit ids
            clash = f"another file has the id of the {self.label} {target.name}"
            raise self.problem(f"{clash}; delete that one first if you don't need it")
        if document["name"] != name:
            with atomic_write(target / self.record) as unfinished:
                unfinished.write_text(json.dumps({**document, "name": name}))

    def _create(self, folder: Path, target: Path, name: str, fill: Callable[[Path], dict[str, Any]]) -> None:
        """Write an asset's files into a staging folder, and rename it when it is complete."""
        folder.mkdir(parents=True, exist_ok=True)
        document = {"format": FORMAT_VERSION, "id": target.name, "name": name, "created": time.time()}
        # servers clean up folders with this prefix, which killed processes leave
        with tempfile.TemporaryDirectory(dir=folder, prefix=UNFINISHED.rstrip("*")) as staging:
            staged_folder = Path(staging) / target.name
            staged_folder.mkdir()
            (staged_folder / self.record).write_text(json.dumps({**document, **fill(staged_folder)}))
            _move_into_place(staged_folder, target)

    def paths(self, folder: Path) -> list[Path]:
        """Folders of all assets in a folder."""
        return [path for path in folder.iterdir() if _ID.fullmatch(path.name)] if folder.is_dir() else []

    def records(self, folder: Path, read: Callable[[Path, str], Entry]) -> list[Entry]:
        """Records of all assets in a folder, newest first; damaged ones are logged and skipped.

        Args:
            folder: folder of the store. read: returns a record by folder and id.
        """
        records = []
        for path in self.paths(folder):
            try:
                records.append(read(folder, path.name))
            except self.problem as problem:
                log.warning("skipped in a list: %s", problem)
            except NotFoundError:  # deleted meanwhile
                continue
        return sorted(records, key=lambda record: (-record.created, record.name))

    def path(self, folder: Path, identity: str) -> Path:
        """Folder of an asset. Raises NotFoundError."""
        if not _ID.fullmatch(identity) or not (folder / identity).is_dir():
            raise NotFoundError(f"there is no {self.label} {identity[:40]!r}; import it first")
        return folder / identity

    def load_record(self, path: Path) -> dict[str, Any]:
        """Read the record in an asset's folder. Raises self.problem if it is damaged."""
        try:
            with (path / self.record).open("rb") as file:
                text = file.read(MAX_JSON_BYTES + 1)
            document = json.loads(text) if len(text) <= MAX_JSON_BYTES else None
        except (OSError, ValueError, RecursionError) as error:
            raise self.damaged_error(path) from error
        if not isinstance(document, dict) or document.get("format") != FORMAT_VERSION:
            raise self.damaged_error(path)
        if not isinstance(document.get("name"), str) or not isinstance(document.get("created"), float):
            raise self.damaged_error(path)
        return document

    def open_array(self, path: Path, file: str) -> np.ndarray[Any, Any]:
        """Memory-map an array of an asset.

        Args:
            path: the asset's folder. file: name of the .npy file in it.
        Raises:
            self.problem: it is damaged.
        """
        try:
            array: np.ndarray[Any, Any] = np.load(path / file, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise self.damaged_error(path) from error
        return array.view(np.ndarray)

    def remove(self, folder: Path, identity: str) -> None:
        """Delete an asset; looks that refer to it are rejected from now on. Raises NotFoundError."""
        remove_folder(self.path(folder, identity))

    def damaged_error(self, path: Path) -> RelumeError:
        """Return the error for a damaged asset."""
        return self.problem(f"the {self.label} {path.name} is damaged; delete its folder and import it again")

    def exists(self, name: str) -> bool:
        """True if a name in a look refers to an available asset."""
        return self._resolve_or_none(name) is not None

    def list_names(self) -> list[str]:
        """Return all names that looks can use."""
        return sorted({self.prefix + path.name for folder in self._folders for path in self.paths(folder)})

    def resolve(self, name: str) -> Path:
        """Return the folder of a look's asset. Raises NotFoundError."""
        path = self._resolve_or_none(name)
        if path is None:
            raise NotFoundError(f"there is no {self.label} {name[:40]!r}; import its file again")
        return path

    def _resolve_or_none(self, name: str) -> Path | None:
        identity = name.removeprefix(self.prefix)
        if identity == name or not _ID.fullmatch(identity):
            return None
        return next((folder / identity for folder in reversed(self._folders) if (folder / identity).is_dir()), None)


def _move_into_place(staged_folder: Path, target: Path) -> None:
    """Rename a complete folder; another process may have been faster."""
    try:
        os.rename(staged_folder, target)
    except OSError:
        if not target.exists():  # otherwise another process imported it in the meantime
            raise
