"""The looks that a batch renders: files, folders of them, stdin, and saved ones."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from cli.naming import spelled
from cli.options import read_json
from relume.errors import NotFoundError, ParameterError

if TYPE_CHECKING:
    from server.records.looks import LookStore

Looks = Annotated[
    list[str] | None,
    typer.Option(
        "--look",
        metavar="LOOK",
        help="Look document: a file, a folder of them, - for stdin, or the name of a saved look; several times for "
        "several. May be partial.",
    ),
]
STDIN = "-"
MAX_LOOKS = 1000


class NamedLook(NamedTuple):
    """A look document, perhaps partial, and what it is called."""

    name: str
    document: dict[str, Any]


def read_looks(given: Sequence[str], saved: LookStore) -> list[NamedLook]:
    """All looks that are meant, in the order in which they were given; the scene's own where none was.

    Args:
        given: as on the command line. saved: looks by name.
    Raises:
        ParameterError: one cannot be read, or is no look. NotFoundError: there is none of that name.
    """
    looks = [look for word in given for look in _meant_by(word, saved)] or [NamedLook("default", {})]
    if len(looks) > MAX_LOOKS:
        raise ParameterError("--look", f"{len(looks)} looks", f"at most {MAX_LOOKS:,}")
    return looks


def _meant_by(word: str, saved: LookStore) -> list[NamedLook]:
    if word == STDIN:
        return _from_stdin()
    path = Path(word)
    if path.is_dir():
        files = sorted(path.glob("*.json"))
        if not 1 <= len(files) <= MAX_LOOKS:
            raise ParameterError("--look", word, f"a folder with 1 to {MAX_LOOKS:,} files that end in .json")
        return [_from_file(file) for file in files]
    if path.is_file() or path.suffix.lower() == ".json" or "/" in word:
        return [_from_file(path)]
    return [_by_name(word, saved)]


def _from_file(path: Path) -> NamedLook:
    return _checked(path.stem, read_json("--look", path), str(path))


def _from_stdin() -> list[NamedLook]:
    """One object is a look, a list has several."""
    document = read_json("--look", None)
    if not isinstance(document, list):
        return [_checked("stdin", document, STDIN)]
    return [_checked(f"{number:04d}", one, f"{STDIN}, number {number}") for number, one in enumerate(document)]


def _checked(name: str, document: object, where: str) -> NamedLook:
    if not isinstance(document, dict):
        raise ParameterError("--look", where, "a JSON object, as GET /api/looks/NAME answers")
    return NamedLook(name, document)


def _by_name(word: str, saved: LookStore) -> NamedLook:
    names = [look.name for look in saved.list()]
    name = spelled(word, names)
    if name in names:
        return _checked(name, json.loads(saved.get(name).document), name)
    known = ", ".join(repr(one) for one in names[:10]) or "none yet"
    raise NotFoundError(f"--look is {word[:80]!r}: no file, no folder and no saved look; saved are: {known}")
