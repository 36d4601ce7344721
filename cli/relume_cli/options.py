"""Options shared by several commands."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relume.core.errors import ParameterError

if TYPE_CHECKING:
    from relume.scene.custom_camera import CustomCamera

Data = Annotated[
    Path | None, typer.Option("--data", metavar="DIR", help="Data directory. [default: RELUME_DATA or user data]")
]
SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="Scene: id, start of an id, or name.")]
BakeName = Annotated[
    str, typer.Argument(metavar="BAKE", help="Bake: id or start of an id; or a scene, for its finest bake.")
]
View = Annotated[str | None, typer.Option("--view", metavar="NAME", help="View. [default: the first]")]
Size = Annotated[str | None, typer.Option("--size", metavar="WxH", help="Width and height in pixels.")]
LookFile = Annotated[
    Path | None,
    typer.Option("--look", metavar="LOOK.json", help="Look document, may be partial. [default: the scene's]"),
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Validate and print what would be done; do nothing.")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler", metavar="tcp://…", help="Dask scheduler to bake on. [default: processes on this machine]"
    ),
]

MAX_DOCUMENT_BYTES = 16 << 20


def parse_size(text: str) -> tuple[int, int]:
    """Parse a width and height such as "640x480". Raises ParameterError."""
    match = re.fullmatch(r"([1-9]\d{0,4})[x×]([1-9]\d{0,4})", text)
    if match is None:
        raise ParameterError("--size", text, "width and height in pixels, such as 640x480")
    return int(match[1]), int(match[2])


def check_readable(option: str, path: Path) -> Path:
    """Return the path. Raises ParameterError if it is not a readable file."""
    try:
        with path.open("rb"):
            return path
    except OSError as error:
        raise ParameterError(option, str(path), f"a file that exists and can be read ({error.strerror})") from None


def read_bounded(option: str, path: Path, max_bytes: int) -> bytes:
    """Read a file of at most `max_bytes`. Raises ParameterError."""
    with check_readable(option, path).open("rb") as file:
        data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise ParameterError(option, str(path), f"a file of at most {max_bytes / 1e6:g} MB")
    return data


def read_look(path: Path | None) -> dict[str, object]:
    """Read a look document; empty without a path. Raises ParameterError."""
    if path is None:
        return {}
    document = read_json("--look", path)
    if not isinstance(document, dict):
        raise ParameterError("--look", str(path), "a file with a JSON object")
    return document


def read_camera(path: Path) -> CustomCamera:
    """Read a camera from a file. Raises ParameterError."""
    from relume.scene.custom_camera import read_custom_camera

    return read_custom_camera(read_json("--camera", path))


def read_json(option: str, path: Path | None) -> object:
    """Read a JSON document of bounded size from a file, or from stdin without a path. Raises ParameterError."""
    if path is None:
        text = sys.stdin.buffer.read(MAX_DOCUMENT_BYTES + 1)
    else:
        with check_readable(option, path).open("rb") as file:
            text = file.read(MAX_DOCUMENT_BYTES + 1)
    source = "-" if path is None else str(path)
    if len(text) > MAX_DOCUMENT_BYTES:
        raise ParameterError(option, source, f"at most {MAX_DOCUMENT_BYTES >> 20} MB of JSON")
    try:
        document: object = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ParameterError(option, source, f"a JSON document ({error})") from None
    return document
