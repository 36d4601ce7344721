"""`relume environment list`: what environments a look may name."""

from __future__ import annotations

import typer

from cli.options import Data


def environment_list(data: Data = None) -> None:
    """List environments as looks name them (`environment.map`): built-in ones, then imported ones, newest first."""
    from cli.data_folder import open_settings
    from relume.environments.asset_store import records
    from relume.environments.built_in import BUILT_IN
    from worker.paths import environments_path

    for name, (label, _) in BUILT_IN.items():
        typer.echo(f"{name:20}  {label}")
    for record in records(environments_path(open_settings(data).data)):
        typer.echo(f"{record.map:20}  {record.name}")
