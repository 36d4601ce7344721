"""`relume reference`: render reference images, and compare bakes with them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from relume_cli.options import Data, LookFile, SceneName, Size, View
from relume_cli.terminal.printing import Json, note, print_result


def reference(
    scene: SceneName,
    output: Annotated[Path, typer.Option(metavar="FILE.exr|.png|.webp", help="Image file to write.")],
    spp: Annotated[int, typer.Option(metavar="N", min=1, max=1 << 20, help="Samples per pixel.")],
    look: LookFile = None,
    view: View = None,
    camera: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Camera instead of a view.")] = None,
    size: Size = None,
    paths: Annotated[
        Literal["all", "method"], typer.Option(help="All light paths, or only those that the bake's method simulates.")
    ] = "all",
    method: Annotated[
        Literal["direct", "gather", "probes"] | None, typer.Option(help="Only light paths that this method simulates.")
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Measure the error of the scene's finest bake, by both kinds of paths.")
    ] = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Render a reference image, and compare a bake with it.

    Brute force: all texels of the environment, traced visibility and indirect light; nothing is baked.
    """
    from relume.core.errors import PlanError
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
        raise PlanError("--compare excludes --camera, --size and --method; leave them out: the bake has its own")
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
