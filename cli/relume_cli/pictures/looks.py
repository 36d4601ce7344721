"""Looks of a batch: files, folders, stdin, and saved looks."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from relume.core.errors import Description, NotFoundError, ParameterError
from relume_cli.name_lookup import match_name
from relume_cli.options import read_json

if TYPE_CHECKING:
    from relume_server.persistence.look_store import LookStore

Looks = Annotated[
    list[str] | None,
    typer.Option(
        "--look",
        metavar="LOOK",
        help="Look document: a file, a folder of them, - for stdin, or the name of a saved look. Repeat for "
        "several. May be partial.",
    ),
]
STDIN = "-"
MAX_LOOKS = 1000


class NamedLook(NamedTuple):
    """A look document, perhaps partial, with its name. `view`: JSON of the view saved with it; None: none."""

    name: str
    document: dict[str, Any]
    view: str | None = None


def read_looks(arguments: Sequence[str], look_store: LookStore) -> list[NamedLook]:
    """Read all looks in the given order; without arguments, the scene's default look.

    Args:
        arguments: as on the command line. look_store: saved looks.
    Raises:
        ParameterError: a look cannot be read, or is invalid. NotFoundError: no saved look has this name.
    """
    looks = [look for argument in arguments for look in _resolve_argument(argument, look_store)] or [
        NamedLook("default", {})
    ]
    if len(looks) > MAX_LOOKS:
        raise ParameterError("--look", Description(f"a list of {len(looks):,} looks"), f"at most {MAX_LOOKS:,} looks")
    return looks


def read_sets(look_store: LookStore) -> list[NamedLook]:
    """Read all saved looks that have a view, by name. Raises NotFoundError if there are none."""
    names = sorted(look.name for look in look_store.list() if look.view is not None)
    if not names:
        raise NotFoundError("no saved look has a view; save one in the editor, or PUT /api/looks/NAME/view")
    return [_by_name(name, look_store) for name in names]


def _resolve_argument(argument: str, look_store: LookStore) -> list[NamedLook]:
    if argument == STDIN:
        return _from_stdin()
    path = Path(argument)
    if path.is_dir():
        files = sorted(path.glob("*.json"))
        if not 1 <= len(files) <= MAX_LOOKS:
            raise ParameterError("--look", argument, f"a folder with 1 to {MAX_LOOKS:,} files that end in .json")
        return [_from_file(file) for file in files]
    if path.is_file() or path.suffix.lower() == ".json" or "/" in argument:
        return [_from_file(path)]
    return [_by_name(argument, look_store)]


def _from_file(path: Path) -> NamedLook:
    return _make_named_look(path.stem, read_json("--look", path), str(path))


def _from_stdin() -> list[NamedLook]:
    """Looks from stdin: an object is one look, a list has several."""
    document = read_json("--look", None)
    if not isinstance(document, list):
        return [_make_named_look("stdin", document, STDIN)]
    return [
        _make_named_look(f"{number:04d}", item, f"{STDIN}, number {number}") for number, item in enumerate(document)
    ]


def _make_named_look(name: str, document: object, source: str) -> NamedLook:
    if not isinstance(document, dict):
        raise ParameterError("--look", source, "a JSON object, as GET /api/looks/NAME returns")
    return NamedLook(name, document)


def _by_name(argument: str, look_store: LookStore) -> NamedLook:
    names = [look.name for look in look_store.list()]
    name = match_name(argument, names)
    if name in names:
        saved = look_store.get(name)
        return NamedLook(name, json.loads(saved.document), saved.view)
    saved_names = ", ".join(repr(look_name) for look_name in names[:10])
    remedy = f"choose from {saved_names}" if names else "save a look first"
    raise NotFoundError(f"--look is {argument[:80]!r}, which is no file, folder or saved look; {remedy}")
