"""Stores of imported things: one folder each, named by the hash of the file it came from.

    <folder>/<id>/<record>    JSON: format, id, name, time of import, and what the kind keeps there
                  …           files of the kind

Look documents name one as "<prefix><id>"; no other string becomes part of a path. A name means the same content
wherever it is found, so a process looks through all folders that it was told to use.
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
    """What every kind's record says of a thing."""

    @property
    def name(self) -> str: ...
    @property
    def created(self) -> float: ...


Entry = TypeVar("Entry", bound=AssetRecord)


def check_name(name: str) -> str:
    """A name that people give, without blanks around it. Raises ParameterError unless it is 1 to 80 printable."""
    name = name.strip()
    if not name.isprintable() or not 1 <= len(name) <= 80:
        raise ParameterError("name", name, "1 to 80 printable characters")
    return name


def _digest(source: Path) -> str:
    with source.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class AssetStore:
    """One kind of imported things.

    Attributes:
        label: one of them is called, in messages. prefix: of names in looks. record: name of the JSON file.
        problem: error where one is damaged or the store is full.
        max_entries: of a folder.
    """

    label: str
    prefix: str
    record: str
    problem: type[RelumeError]
    max_entries: int
    _folders: list[Path] = field(default_factory=list)

    def add_search_folder(self, folder: Path) -> None:
        """Find things of this folder too from now on; it need not exist yet."""
        self._folders.append(folder)

    @contextmanager
    def with_search_folder(self, folder: Path) -> Iterator[Path]:
        """Find things of this folder too for as long as the block runs."""
        self.add_search_folder(folder)
        try:
            yield folder
        finally:
            self._folders.remove(folder)

    @staticmethod
    def content_id(source: Path) -> str:
        """The id of what a file holds."""
        return _digest(source)[:ID_DIGITS]

    def store(self, folder: Path, source: Path, name: str, fill: Callable[[Path], dict[str, Any]]) -> str:
        """Keep what a file holds under the file's hash, and return its id; what is here already takes the new name.

        Args:
            folder: where things of this kind are kept. source: the file.
            name: that people read.
            fill: writes the kind's files into an empty folder, and returns what the record says besides.
        Raises:
            self.problem: the store is full, or what is here under the id came from another file. And what `fill`
                raises; then nothing is kept.
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
        """Take over a thing that was kept in a folder on the same disk; what is here already takes its name.

        Args:
            folder: where things of this kind are kept. staged_folder: the thing's own folder.
        Raises:
            self.problem: the store is full, it is damaged, or what is here under the id came from another file.
        """
        record, target = self.load_record(staged_folder), folder / staged_folder.name
        if not target.exists():
            self._check_capacity(folder)
            folder.mkdir(parents=True, exist_ok=True)
            _move_into_place(staged_folder, target)
        self._set_name(target, record["name"], record.get("sha256"))

    def _check_capacity(self, folder: Path) -> None:
        if len(self.paths(folder)) >= self.max_entries:
            raise self.problem(f"{self.max_entries} {self.label}s are kept already; delete one first")

    def _set_name(self, target: Path, name: str, digest: str | None) -> None:
        """Give a thing that is here its newest name, if it came from the same file."""
        document = self.load_record(target)
        if document.get("sha256", digest) != digest:  # two files were made for that: it takes billions of tries
            clash = f"another file is the {self.label} {target.name}"
            raise self.problem(f"{clash}; delete that one first, if it is not yours")
        if document["name"] != name:
            with atomic_write(target / self.record) as unfinished:
                unfinished.write_text(json.dumps({**document, "name": name}))

    def _create(self, folder: Path, target: Path, name: str, fill: Callable[[Path], dict[str, Any]]) -> None:
        """Write a thing's folder, and give it its name when it is complete."""
        folder.mkdir(parents=True, exist_ok=True)
        document = {"format": FORMAT_VERSION, "id": target.name, "name": name, "created": time.time()}
        # by this name a server finds what a killed process left
        with tempfile.TemporaryDirectory(dir=folder, prefix=UNFINISHED.rstrip("*")) as staging:
            staged_folder = Path(staging) / target.name
            staged_folder.mkdir()
            (staged_folder / self.record).write_text(json.dumps({**document, **fill(staged_folder)}))
            _move_into_place(staged_folder, target)

    def paths(self, folder: Path) -> list[Path]:
        """Folders of all things in a folder."""
        return [path for path in folder.iterdir() if _ID.fullmatch(path.name)] if folder.is_dir() else []

    def records(self, folder: Path, read: Callable[[Path, str], Entry]) -> list[Entry]:
        """Records of all things in a folder, newest first; one that is damaged, which the log names, hides no others.

        Args:
            folder: of the store. read: the record of one, by folder and id.
        """
        records = []
        for path in self.paths(folder):
            try:
                records.append(read(folder, path.name))
            except self.problem as problem:
                log.warning("left out of a list: %s", problem)
            except NotFoundError:  # deleted meanwhile
                continue
        return sorted(records, key=lambda record: (-record.created, record.name))

    def path(self, folder: Path, identity: str) -> Path:
        """Folder of one thing. Raises NotFoundError."""
        if not _ID.fullmatch(identity) or not (folder / identity).is_dir():
            raise NotFoundError(f"there is no {self.label} {identity[:40]!r}; import it first")
        return folder / identity

    def load_record(self, path: Path) -> dict[str, Any]:
        """The record of a thing by its folder. Raises self.problem where it is damaged."""
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
        """An array of a thing by its folder, which stays on the disk and is read where it is needed.

        Args:
            path: the folder. file: name of the .npy file in it.
        Raises:
            self.problem: it is damaged.
        """
        try:
            array: np.ndarray[Any, Any] = np.load(path / file, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise self.damaged_error(path) from error
        return array.view(np.ndarray)

    def remove(self, folder: Path, identity: str) -> None:
        """Delete a thing; looks that name it are refused from now on. Raises NotFoundError."""
        remove_folder(self.path(folder, identity))

    def damaged_error(self, path: Path) -> RelumeError:
        """The error to raise."""
        return self.problem(f"the {self.label} {path.name} is damaged; delete its folder and import it again")

    def exists(self, name: str) -> bool:
        """Whether a look's name means a thing that is here."""
        return self._resolve_or_none(name) is not None

    def list_names(self) -> list[str]:
        """All names that mean something."""
        return sorted({self.prefix + path.name for folder in self._folders for path in self.paths(folder)})

    def resolve(self, name: str) -> Path:
        """The folder of what a look names. Raises NotFoundError."""
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
    """Give a folder that is complete its name."""
    try:
        os.rename(staged_folder, target)
    except OSError:
        if not target.exists():  # somebody else has imported it in the meantime
            raise
