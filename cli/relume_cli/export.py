"""`relume export`: write a scene with a look as a file of other programs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from relume_cli.options import Data, DryRun, SceneName
from relume_cli.pictures.looks import Looks
from relume_cli.terminal.printing import Json, note, print_result


def export(
    scene: SceneName,
    output: Annotated[Path, typer.Argument(metavar="FILE.glb", help="File to write; its suffix is the format.")],
    look: Looks = None,
    dry_run: DryRun = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Export a scene with a look.

    The first --look is that of the file, by default the scene's own; further ones become material variants. Materials
    that the format cannot express are fitted; a warning gives the error of each. A file name ending in .json is a light
    mix: brightness and color of the lights by name.
    """
    from relume.core.errors import ParameterError
    from relume.export.export_document import light_mix_warnings, look_of_scene, prepare_export
    from relume.export.export_scene import export_report, format_of
    from relume_cli.data_folder import find_scene, open_bakes, open_settings
    from relume_cli.pictures.looks import read_looks
    from relume_server.persistence.look_store import LookStore
    from relume_worker.tasks import load_registered_scene

    file_format = format_of(output)
    if not output.parent.is_dir():
        raise ParameterError("FILE", str(output), "a file in a folder that exists")
    service = open_bakes(open_settings(data))
    try:
        record = find_scene(service.ledger, scene)
        named_looks = read_looks(look or (), LookStore(service.ledger.sessions))
        loaded = load_registered_scene(service.data_dir, record.id)
    finally:
        service.close()
    looks = {each.name: look_of_scene(loaded, each.document, f"look {each.name!r}") for each in named_looks}
    if len(looks) < len(named_looks):
        raise ParameterError("--look", [each.name for each in named_looks], "looks with different names")
    first, *others = looks.items()
    prepared = prepare_export(loaded, first[1], dict(others), has_materials=file_format.has_materials)
    prepared = replace(prepared, warnings=light_mix_warnings(loaded, [each.document for each in named_looks]))
    report = export_report(prepared, file_format)
    if not dry_run:
        file_format.write(prepared, output)
    document = {"path": str(output), **report.document()}
    print_result(document, str(output), as_json=as_json)
    for sentence in report.sentences():
        note(f"warning: {sentence}")
