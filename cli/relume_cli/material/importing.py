"""`relume material import`: import a measured material or a BTF."""

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
            metavar="FILE.binary|.bsdf|.brdf|.zip|.btf",
            help="BRDF (MERL, RGL, or Cornell's scattered values), UBO2003 BTF images in a ZIP, or UBO2014 BTF.",
        ),
    ],
    name: Annotated[str | None, typer.Option(help="Name of the material. [default: file name]")] = None,
    error: Annotated[float, typer.Option(help="BTF: relative RMS error allowed in compression.")] = 0.05,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Import a measured material; print its name in looks.

    Prints its terms and its compression error as well.
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
        f"  {model}: error of the curves {', '.join(f'{channel_error:.1%}' for channel_error in errors)} (red, green, "
        f"blue)"
        for model, errors in model_errors
    ]
    lines += [f"  warning: {warning}" for warning in record.warnings]
    print_material(record, lines, as_json=as_json)


def _import_btf(folder: Path, file: Path, name: str, bound: float, *, as_json: bool) -> None:
    from relume.assets.btf.import_btf import import_btf
    from relume_cli.interrupts import until_interrupted
    from relume_cli.material.messages import print_btf
    from relume_worker.paths import btfs_path

    record = until_interrupted(
        file.name, lambda progress, is_canceled: import_btf(btfs_path(folder), file, name, bound, progress, is_canceled)
    )
    print_btf(record, as_json=as_json)
