"""`relume material import`: keeps a measured material, or a BTF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relume_cli.options import Data, check_readable
from relume_cli.terminal.printing import Json

_BTFS = (".zip", ".btf")


def material_import(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.binary|FILE.zip|FILE.btf",
            help="Isotropic BRDF in the MERL layout, images by light and view (UBO2003), or a container (UBO2014).",
        ),
    ],
    name: Annotated[str | None, typer.Option(help="What to call it; else the file's name.")] = None,
    error: Annotated[float, typer.Option(help="Of a BTF: relative RMS that compression may miss.")] = 0.05,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Import a measured material; print its name in looks.

    Beside it stand its terms, and how well it is kept.
    """
    from relume.assets.asset_store import check_name
    from relume.assets.measured.measured_store import store_material
    from relume_cli.data_folder import open_settings
    from relume_cli.material.messages import print_material
    from relume_worker.paths import materials_path

    check_readable("FILE", file)
    folder, asset_name = open_settings(data).data, check_name(name or file.stem)
    if file.suffix.lower() in _BTFS:
        _import_btf(folder, file, asset_name, error, as_json=as_json)
        return
    record = store_material(materials_path(folder), file, asset_name)
    model_errors = (("measured_lv + measured_hd", record.lobes_error), ("measured_hf", record.homomorphic_error))
    lines = [
        f"  {model}: curves alone err by {', '.join(f'{channel_error:.1%}' for channel_error in errors)} (red, green, "
        f"blue)"
        for model, errors in model_errors
    ]
    print_material(record, lines, as_json=as_json)


def _import_btf(folder: Path, file: Path, name: str, bound: float, *, as_json: bool) -> None:
    from relume.assets.btf.import_btf import import_btf
    from relume_cli.interrupts import until_interrupted
    from relume_cli.material.messages import print_btf
    from relume_worker.paths import btfs_path

    record = until_interrupted(
        file.name,
        lambda progress, is_canceled: import_btf(btfs_path(folder), file, name, bound, progress, is_canceled),
    )
    print_btf(record, as_json=as_json)
