"""`relume environment import`: import an environment that looks of any scene can use."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relume_cli.options import Data, check_readable
from relume_cli.terminal.printing import Json, print_result


def environment_import(
    file: Annotated[Path, typer.Argument(metavar="FILE.hdr", help="Equirectangular .hdr or .exr file.")],
    name: Annotated[str | None, typer.Option(help="Name of the environment. [default: file name]")] = None,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Import an environment; print its name in looks.

    Prints a warning for each change to its pixels.
    """
    from relume.assets.asset_store import check_name
    from relume.assets.environments.environment_store import store_environment
    from relume_cli.data_folder import open_settings
    from relume_worker.paths import environments_path

    check_readable("FILE", file)
    record = store_environment(environments_path(open_settings(data).data), file, check_name(name or file.stem))
    document = {"id": record.id, "map": record.reference, "name": record.name, "warnings": list(record.warnings)}
    print_result(document, record.reference, as_json=as_json)
    for warning in record.warnings:
        typer.echo(f"warning: {warning}", err=True)
