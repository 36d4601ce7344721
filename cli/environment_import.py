"""`relume environment import`: keeps an environment that any baked scene can be shown in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.options import Data


def environment_import(
    file: Annotated[Path, typer.Argument(metavar="FILE.hdr", help="Equirectangular light, .hdr or .exr.")],
    name: Annotated[str | None, typer.Option(help="What to call it; else the file's name.")] = None,
    data: Data = None,
) -> None:
    """Import an environment; print its name in looks, and a warning for each thing that was changed."""
    from cli.data_folder import open_settings
    from relume.asset_store import check_name
    from relume.environments.asset_store import keep
    from relume.errors import ParameterError
    from worker.paths import environments_path

    if not file.is_file():
        raise ParameterError("FILE", file.name, "a file that exists")
    record = keep(environments_path(open_settings(data).data), file, check_name(name or file.stem))
    typer.echo(record.map)
    for warning in record.warnings:
        typer.echo(f"warning: {warning}", err=True)
