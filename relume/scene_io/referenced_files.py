"""The files that a scene file names: beside it in its folder, in the same archive or upload, or nowhere."""

from __future__ import annotations

import posixpath
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Generic, Protocol, TypeVar
from urllib.parse import unquote

from relume.core.errors import SceneError

MAX_BYTES = 512 << 20  # of all companions of a scene together
Entry = TypeVar("Entry")


class Companions(Protocol):
    """Reads the files that a scene file names."""

    def read(self, name: str, label: str) -> bytes | None:
        """The content of a companion; None where there is no such file.

        Raises:
            SceneError: the name points out of the folder or the archive, or the file cannot be read or is too large.
        """


def relative_path(name: str, label: str) -> str:
    """The name as a plain relative path with forward slashes.

    Raises:
        SceneError: it is absolute, a URL, or climbs out of its folder.
    """
    plain = posixpath.normpath(name.replace("\\", "/"))
    if plain.startswith(("/", "../")) or plain in ("..", ".") or ":" in plain or not plain.isprintable():
        printable = name[:60].encode("ascii", "replace").decode()
        raise SceneError(f"{label} lies outside the folder of the scene ({printable!r}); put it beside the scene file")
    return plain


class NoFiles:
    """A scene file without companions, such as a single upload."""

    def read(self, name: str, label: str) -> bytes | None:
        """Nothing, whatever the name; one that points elsewhere is refused all the same."""
        relative_path(unquote(name), label)
        return None


class Folder:
    """The folder of a scene file, and the folders in it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()
        self._remaining_bytes = MAX_BYTES

    def read(self, name: str, label: str) -> bytes | None:
        """As `Companions.read`; links are followed only where they stay in the folder."""
        for spelling in dict.fromkeys((unquote(name), name)):
            plain = relative_path(spelling, label)
            try:
                path = (self._folder / plain).resolve()
                if not path.is_relative_to(self._folder):
                    raise SceneError(f"{label} is a link out of the folder of the scene; put the file there")
                if not path.is_file():
                    continue
                self._remaining_bytes -= path.stat().st_size
                if self._remaining_bytes < 0:
                    raise SceneError(f"the files beside the scene have over {MAX_BYTES >> 20} MB; scale them down")
                return path.read_bytes()
            except (OSError, ValueError) as problem:
                if isinstance(problem, SceneError):
                    raise
                raise SceneError(f"{label} cannot be read; check the file beside the scene") from None
        return None


class NamedFiles(Generic[Entry]):
    """Files known by their names, folders included, none of which is a path on this disk."""

    def __init__(self, entries: Mapping[str, Entry], folder: str, read: Callable[[Entry], bytes]) -> None:
        """
        Args:
            entries: what `read` takes, by name. folder: of the scene file, among those names.
        """
        self._entries = {posixpath.normpath(name.replace("\\", "/")).lower(): entry for name, entry in entries.items()}
        self._folder, self._read = folder, read

    def read(self, name: str, label: str) -> bytes | None:
        """Read a file as `Companions.read` does; upper and lower case are the same."""
        for spelling in dict.fromkeys((unquote(name), name)):
            plain = posixpath.normpath(posixpath.join(self._folder, spelling.replace("\\", "/")))
            entry = self._entries.get(relative_path(plain, label).lower())
            if entry is not None:
                return self._read(entry)
        return None


class Archive(NamedFiles[zipfile.ZipInfo]):
    """The other entries of a .zip file, read in memory; nothing is ever unpacked to the disk."""

    def __init__(self, archive: zipfile.ZipFile, folder: str) -> None:
        entries = {info.filename: info for info in archive.infolist()}
        super().__init__(entries, folder, lambda entry: read_entry(archive, entry))


class UploadedFiles(NamedFiles[Path]):
    """The files that were uploaded with a scene."""

    def __init__(self, files: Mapping[str, Path], scene: str) -> None:
        """
        Args:
            files: where they lie now, by the names they had. scene: the name of the scene's own file.

        Raises:
            SceneError: together they are too large.
        """
        if sum(path.stat().st_size for path in files.values()) > MAX_BYTES:
            raise SceneError(f"the files beside the scene have over {MAX_BYTES >> 20} MB; scale them down")
        super().__init__(files, posixpath.dirname(scene.replace("\\", "/")), Path.read_bytes)


def read_entry(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> bytes:
    """One entry, never longer than it claims. Raises SceneError where it is damaged."""
    try:
        with archive.open(entry) as file:
            return file.read(entry.file_size)
    except Exception:  # zipfile and zlib raise many kinds for damaged data
        raise SceneError("an entry of the .zip file is damaged; pack it again") from None
