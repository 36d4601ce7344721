"""The files that a scene or material file names, on the command line: in its folder, or below --root."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relume.core.errors import MaterialError, SceneError

if TYPE_CHECKING:
    from relume.scene_io.referenced_files import Folder

Root = Annotated[
    Path | None,
    typer.Option(
        "--root",
        metavar="DIR",
        file_okay=False,
        exists=True,
        help="Folder above FILE with the files it names by ../. [default: the folder of FILE]",
    ),
]


@contextmanager
def open_companions(file: Path, root: Path | None) -> Iterator[Folder]:
    """The files below the root that a file names; says which root would add those outside it.

    Args:
        file: scene or material file. root: None for its folder.
    Raises:
        SceneError: the file is not below the root.
    """
    from relume.scene_io.referenced_files import Folder

    companions = Folder(file.parent, root)
    try:
        yield companions
    except (SceneError, MaterialError) as error:
        raise type(error)("; ".join([str(error), *_advice(companions)])) from None
    for line in _advice(companions):
        typer.echo(line, err=True)


def _advice(companions: Folder) -> list[str]:
    root = companions.sufficient_root()
    return [] if root is None else [f"--root '{root}' also reads the files outside the scene's folder"]
