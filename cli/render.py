"""`relume render`: one exact frame without a server."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.options import Data, LookFile, SceneName, View, read_look

Output = Annotated[Path, typer.Option(metavar="FILE.exr|.png|.webp", help="Where to write the picture.")]


def render(
    scene: SceneName,
    output: Output,
    look: LookFile = None,
    view: View = None,
    layers: Annotated[bool, typer.Option("--layers", help="EXR: add a layer for each light and light path.")] = False,
    full_float: Annotated[bool, typer.Option("--float", help="EXR: full floats instead of half ones.")] = False,
    data: Data = None,
) -> None:
    """Render one exact frame of a baked scene."""
    from cli.data_folder import complete_look, find_bake, find_scene, open_bakes, open_settings
    from cli.picture import check_output, save, save_exr
    from relume.errors import ParameterError
    from relume.exr.attributes import Origin
    from relume.memory import Memory
    from relume.methods.registry import open_bake
    from relume.picture.transfer import Eyes
    from relume.render.image import render_image

    check_output(output)
    is_exr = output.suffix.lower() == ".exr"
    if (layers or full_float) and not is_exr:
        raise ParameterError("--output", output.name, "a file name that ends in .exr, for --layers and --float")
    partial = read_look(look)
    service = open_bakes(open_settings(data))
    try:
        record = find_scene(service.ledger, scene)
        bake, view_name = find_bake(service, record, view)
        transfer = open_bake(service.store_path(bake.id), Memory(4 << 30))
        if not bake.is_current:
            typer.echo(f"note: another version of relume made this bake; anew: relume bake {scene}", err=True)
        if transfer.eyes is Eyes.FREE:
            typer.echo("note: the eye of this bake moves: its pictures are approximate; exact: relume bake", err=True)
        document = complete_look(partial, transfer.default_look)
        if document.environment.map is not None:
            typer.echo("note: shadows were baked before this light was known: small lamps' are less exact", err=True)
        if is_exr:
            origin = Origin(record.id, record.name, bake.id)
            save_exr(output, transfer, view_name, document, origin, layers, "float" if full_float else "half")
        else:
            save(output, render_image(transfer, view_name, document, for_display=True), document)
    finally:
        service.close()
