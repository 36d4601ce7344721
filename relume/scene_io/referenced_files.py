"""Files that a scene file refers to: in its folder, in the same archive or upload, or none."""

from __future__ import annotations

import posixpath
import re
import unicodedata
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Generic, Protocol, TypeVar
from urllib.parse import unquote

from relume.core.errors import SceneError
from relume.core.import_warnings import UNREADABLE

ABSOLUTE = re.compile(r"[A-Za-z]:|[A-Za-z][\w+.-]*:/|:")
"""Start of a path with a drive letter, or of a URL; a colon elsewhere is part of a name."""
_UTF_8_FLAG = 0x800  # of names in .zip files
MAX_BYTES = 512 << 20  # of all companions of a scene
Entry = TypeVar("Entry")


class Companions(Protocol):
    """Reads the files that a scene file refers to."""

    def read(self, name: str, label: str) -> bytes | None:
        """Return the content of a companion; None if it does not exist.

        Raises:
            SceneError: the name leaves the folder or archive, or the file is unreadable or too large.
        """


def relative_path(name: str, label: str) -> str:
    """Normalize a name to a relative path with forward slashes.

    Raises:
        SceneError: it is absolute, a URL, or leaves its folder.
    """
    plain = posixpath.normpath(name.replace("\\", "/"))
    is_absolute = plain.startswith(("/", "../")) or ABSOLUTE.match(plain) is not None
    if is_absolute or plain in ("..", ".") or UNREADABLE.search(plain):
        printable = name[:60].encode("ascii", "replace").decode()
        raise SceneError(f"{label} is outside the scene's folder ({printable!r}); put it next to the scene file")
    return plain


class NoFiles:
    """A scene file without companions, such as a single upload."""

    def read(self, name: str, label: str) -> bytes | None:
        """Return None; an invalid name still raises SceneError."""
        relative_path(unquote(name), label)
        return None


class Folder:
    """The folder of a scene file, with its subfolders; with a root, those of a folder above it, too."""

    def __init__(self, folder: Path, root: Path | None = None) -> None:
        """
        Args:
            folder: of the scene file; names are relative to it. root: files below it may be read; None for `folder`.

        Raises:
            SceneError: the folder is not below the root.
        """
        inner = folder.resolve()
        self._root = inner if root is None else root.resolve()
        if not inner.is_relative_to(self._root):
            raise SceneError(f"{inner} is not below the root {self._root}; give a folder above the scene file")
        self._folder = inner.relative_to(self._root).as_posix()
        self._outside = set[Path]()
        self._remaining_bytes = MAX_BYTES

    def read(self, name: str, label: str) -> bytes | None:
        """Read a file as `Companions.read` does; links are only followed below the root."""
        for spelling in dict.fromkeys((unquote(name), name)):
            plain = self._inside(spelling, label)
            try:
                path = _any_case(self._root, plain).resolve()
                if not path.is_relative_to(self._root):
                    self._outside.add(path)
                    raise SceneError(f"{label} is a link that leaves the scene's folder; copy the file there")
                if not path.is_file():
                    continue
                self._remaining_bytes -= path.stat().st_size
                if self._remaining_bytes < 0:
                    raise SceneError(f"the files next to the scene have over {MAX_BYTES >> 20} MB; scale them down")
                return path.read_bytes()
            except (OSError, ValueError) as problem:
                if isinstance(problem, SceneError):
                    raise
                raise SceneError(f"{label} cannot be read; check the file next to the scene") from None
        return None

    def _inside(self, name: str, label: str) -> str:
        """A name relative to the root; one that leaves it is stored. Raises SceneError as `relative_path` does."""
        plain = posixpath.normpath(posixpath.join(self._folder, name.replace("\\", "/")))
        try:
            return relative_path(plain, label)
        except SceneError:
            if plain.startswith("../"):
                self._outside.add(Path(posixpath.normpath(self._root / plain)))
            raise

    def sufficient_root(self) -> Path | None:
        """The innermost folder with all existing files that were asked for and lie outside; None if there are none."""
        outside = [str(path.parent) for path in self._outside if _is_file(path)]
        return Path(posixpath.commonpath([str(self._root), *outside])) if outside else None


def _is_file(path: Path) -> bool:
    """True if a file exists, whatever its name holds."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _any_case(folder: Path, name: str) -> Path:
    """The path of a file; where none has that spelling, of one that differs in case or in Unicode's normal form."""
    path = folder / name
    if path.exists():
        return path
    path = folder
    for component in name.split("/"):
        exact = path / component
        names = [] if exact.exists() or not path.is_dir() else [entry.name for entry in path.iterdir()]
        path = path / next((name for name in sorted(names) if fold(name) == fold(component)), component)
    return path


def fold(name: str) -> str:
    """A name without differences of case and of Unicode's normal forms."""
    return unicodedata.normalize("NFC", name).casefold()


class NamedFiles(Generic[Entry]):
    """Files by name, including folders, independent of paths on disk.

    Attributes:
        folder: folder of the scene file, within those names.
    """

    def __init__(self, entries: Mapping[str, Entry], folder: str, read: Callable[[Entry], bytes]) -> None:
        """
        Args:
            entries: entries by name, passed to `read`. folder: folder of the scene file, within those names.
        """
        self._entries = {fold(posixpath.normpath(name.replace("\\", "/"))): entry for name, entry in entries.items()}
        self.folder, self._read = folder, read

    def read(self, name: str, label: str) -> bytes | None:
        """Read a file as `Companions.read` does; names are case-insensitive."""
        for spelling in dict.fromkeys((unquote(name), name)):
            plain = posixpath.normpath(posixpath.join(self.folder, spelling.replace("\\", "/")))
            entry = self._entries.get(fold(relative_path(plain, label)))
            if entry is not None:
                return self._read(entry)
        return None


class Archive(NamedFiles[zipfile.ZipInfo]):
    """The other entries of a .zip file, read in memory without extracting them."""

    def __init__(self, archive: zipfile.ZipFile, folder: str) -> None:
        entries = {entry_name(info): info for info in archive.infolist()}
        super().__init__(entries, folder, lambda entry: read_entry(archive, entry))


class UploadedFiles(NamedFiles[Path]):
    """The files that were uploaded with a scene."""

    def __init__(self, files: Mapping[str, Path], scene: str) -> None:
        """
        Args:
            files: current paths by original name. scene: original name of the scene file.

        Raises:
            SceneError: the files are too large in total.
        """
        if sum(path.stat().st_size for path in files.values()) > MAX_BYTES:
            raise SceneError(f"the files next to the scene have over {MAX_BYTES >> 20} MB; scale them down")
        super().__init__(files, posixpath.dirname(scene.replace("\\", "/")), Path.read_bytes)


def entry_name(entry: zipfile.ZipInfo) -> str:
    """Name of an entry: UTF-8 also where the archive doesn't say so, as those of USD and macOS, else code page 437."""
    if not entry.flag_bits & _UTF_8_FLAG:
        with suppress(UnicodeError):
            return entry.filename.encode("cp437").decode("utf-8")
    return entry.filename


def read_entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> bytes:
    """Read an entry up to its declared size. Raises SceneError if it is damaged."""
    try:
        with archive.open(entry) as file:
            return file.read(entry.file_size)
    except Exception:  # zipfile and zlib raise many kinds for damaged data
        raise SceneError("an entry of the .zip file is damaged; pack it again") from None
