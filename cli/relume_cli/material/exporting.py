"""`relume material export`: write a material of a look as a MERL file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relume_cli.options import Data, read_look
from relume_cli.terminal.printing import Json, print_result


def material_export(
    look: Annotated[Path, typer.Argument(metavar="LOOK.json", help="Look document; may be partial.")],
    material: Annotated[str, typer.Argument(metavar="MATERIAL", help="Name of a material in the look.")],
    output: Annotated[Path, typer.Option(metavar="FILE.binary", help="File to write.")],
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Write an edited material as a MERL file.

    For other renderers. All terms must be isotropic.
    """
    from relume.assets.measured.merl import write_merl
    from relume.brdf.merl_export import sample_terms
    from relume.core.errors import ParameterError
    from relume.look import complete, default_look
    from relume.scene.model import Material
    from relume_cli.data_folder import open_settings

    open_settings(data)
    if not output.parent.is_dir():
        raise ParameterError("--output", str(output), "a file in a folder that exists")
    materials = read_look(look).get("materials")
    material_look = materials.get(material) if isinstance(materials, dict) else None
    if not isinstance(material_look, dict) or "terms" not in material_look:
        raise ParameterError("MATERIAL", material, "a material whose terms are in the look")
    document = complete({"materials": {material: material_look}}, default_look([Material(material, ())]))
    write_merl(output, sample_terms(document["materials"][material]["terms"]))
    print_result({"path": str(output), "material": material}, str(output), as_json=as_json)
