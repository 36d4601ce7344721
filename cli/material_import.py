"""`relume material import`: keeps a measured material."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.options import Data


def material_import(
    file: Annotated[Path, typer.Argument(metavar="FILE.binary", help="Isotropic BRDF in the MERL layout.")],
    name: Annotated[str | None, typer.Option(help="What to call it; else the file's name.")] = None,
    data: Data = None,
) -> None:
    """Import a measured material; print its name in looks, and how well its curves do alone."""
    import json

    from cli.data_folder import open_settings
    from relume.asset_store import check_name
    from relume.measured.asset_store import keep
    from worker.paths import materials_path

    record = keep(materials_path(open_settings(data).data), file, check_name(name or file.stem))
    typer.echo(record.data)
    typer.echo(f"  {json.dumps({'terms': record.terms()})}")
    for model, errors in (
        ("measured_lv + measured_hd", record.lobes_error),
        ("measured_hf", record.homomorphic_error),
    ):
        typer.echo(f"  {model}: curves alone err by {', '.join(f'{error:.1%}' for error in errors)} (red, green, blue)")
