"""`relume environment import`: keeps an environment that any baked scene can be shown in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relume_cli.options import Data, check_readable
from relume_cli.terminal.printing import Json, print_result


def environment_import(
    file: Annotated[Path, typer.Argument(metavar="FILE.hdr", help="Equirectangular light, .hdr or .exr.")],
    name: Annotated[str | None, typer.Option(help="What to call it; else the file's name.")] = None,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Import an environment; print its name in looks.

    There is a warning for each thing that was changed.
    """
    from relume.assets.asset_store import check_name
    from relume.assets.environments.environment_store import store_environment
    from relume_cli.data_folder import open_settings
    from relume_worker.paths import environments_path

    check_readable("FILE", file)
    record = store_environment(environments_path(open_settings(data).data), file, check_name(name or file.stem))
    document = {"id": record.id, "map": record.map, "name": record.name, "warnings": list(record.warnings)}
    print_result(document, record.map, as_json=as_json)
    for warning in record.warnings:
        typer.echo(f"warning: {warning}", err=True)
