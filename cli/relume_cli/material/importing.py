"""`relume material import`: import a measured material, a BTF, or the materials of a MaterialX document."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from relume.archives.bounded import open_bounded
from relume_cli.companion_files import Root, open_companions
from relume_cli.options import Data, check_readable
from relume_cli.terminal.printing import Json, print_result

_BTFS = (".zip", ".btf")
_MAX_DIRECTORY_BYTES = 64 << 20


def material_import(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.binary|.bsdf|.brdf|.zip|.btf|.mtlx",
            help="BRDF (MERL, RGL, or Cornell's scattered values), UBO2003 BTF images in a ZIP, UBO2014 BTF, or "
            "MaterialX, also in a ZIP with its images.",
        ),
    ],
    name: Annotated[str | None, typer.Option(help="Name of the material. [default: file name]")] = None,
    error: Annotated[float, typer.Option(help="BTF: relative RMS error allowed in compression.")] = 0.05,
    root: Root = None,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Import a material; print its name in looks.

    Prints its terms and its compression error as well; of MaterialX, the id in the library and the looks of all
    materials.
    """
    from relume.assets.asset_store import check_name
    from relume.assets.measured.measured_store import store_material
    from relume_cli.data_folder import open_settings
    from relume_cli.material.messages import print_material
    from relume_worker.paths import materials_path

    check_readable("FILE", file)
    folder, asset_name = open_settings(data).data, check_name(name or file.stem)
    if _is_materialx(file):
        _import_materialx(folder, file, asset_name, root, as_json=as_json)
        return
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


def _is_materialx(file: Path) -> bool:
    if file.suffix.lower() != ".zip":
        return file.suffix.lower() == ".mtlx"
    try:
        with file.open("rb") as archive:
            names = open_bounded(archive, _MAX_DIRECTORY_BYTES).namelist()
    except Exception:  # zipfile raises many kinds for damaged data, which the import of BTFs reports
        return False
    return any(name.lower().endswith(".mtlx") for name in names)


def _import_materialx(folder: Path, file: Path, name: str, root: Path | None, *, as_json: bool) -> None:
    from relume.imported_materials.material_store import store_materials
    from relume_worker.paths import images_path, imported_materials_path

    target = imported_materials_path(folder)
    with open_companions(file, root) as companions:
        record = store_materials(target, images_path(folder), file, name, companions)
    materials = [{"name": material.name, **material.look} for material in record.materials]
    warnings = [warning.document() for warning in record.warnings]
    document = {"id": record.id, "name": record.name, "materials": materials, "warnings": warnings}
    lines = [f"  {json.dumps(material)}" for material in materials]
    lines += [f"  warning: {warning}" for warning in record.warnings]
    print_result(document, record.id, as_json=as_json, details=lines)


def _import_btf(folder: Path, file: Path, name: str, bound: float, *, as_json: bool) -> None:
    from relume.assets.btf.import_btf import import_btf
    from relume_cli.interrupts import until_interrupted
    from relume_cli.material.messages import print_btf
    from relume_worker.paths import btfs_path

    record = until_interrupted(
        file.name, lambda progress, is_canceled: import_btf(btfs_path(folder), file, name, bound, progress, is_canceled)
    )
    print_btf(record, as_json=as_json)
