"""`relume reference`: brute-force reference images, and comparisons with them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from relume_cli.options import Data, LookFile, SceneName, Size, View
from relume_cli.terminal.printing import Json, note, print_result


def reference(
    scene: SceneName,
    output: Annotated[Path, typer.Option(metavar="FILE.exr|.png|.webp", help="Where to write the picture.")],
    spp: Annotated[int, typer.Option(metavar="N", min=1, max=1 << 20, help="Samples per pixel.")],
    look: LookFile = None,
    view: View = None,
    camera: Annotated[Path | None, typer.Option(metavar="FILE.json", help="View from here instead.")] = None,
    size: Size = None,
    paths: Annotated[
        Literal["all", "method"],
        typer.Option(help="All light paths, or those of the method that the scene is baked with."),
    ] = "all",
    method: Annotated[
        Literal["direct", "gather", "probes"] | None, typer.Option(help="Light paths of this method, baked or not.")
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Say how far the scene's finest bake is from it, by both kinds of paths.")
    ] = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Render by brute force, and compare a bake with it.

    Every texel of the light counts, visibility is traced, and so are paths between surfaces; nothing is baked.
    """
    from relume.core.errors import ParameterError
    from relume_cli.pictures.files import check_display_view, check_output, save
    from relume_cli.reference.passes import (
        compare_passes,
        document,
        find_bake_comparison,
        find_reference_subject,
        report_lines,
    )
    from relume_cli.terminal.progress import progress

    check_output(output)
    if compare and (camera, size, method) != (None, None, None):
        raise ParameterError("--compare", "with --camera, --size or --method", "none of these: a bake has its own")
    if compare:
        subject = find_bake_comparison(data, scene, look, view)
    else:
        subject = find_reference_subject(data, scene, look, view, camera, size, method, needs_bake=paths == "method")
    check_display_view(output, subject.look)
    path_set = paths if method is None else "method"
    with progress("reference") as report:
        passes = compare_passes(subject, spp, path_set, report)
    save(output, passes.estimates[path_set].mean, subject.look)
    if as_json:
        print_result({"path": str(output), "spp": spp, **document(subject, passes, path_set)}, "", as_json=True)
        return
    (note if compare else typer.echo)(str(output))
    for line in report_lines(subject, passes, path_set):
        typer.echo(line, err=not compare)
