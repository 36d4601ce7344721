"""`relume reference`: brute-force truth, for error figures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from cli.options import Data, LookFile, SceneName, Size, View
from cli.render import Output


def reference(
    scene: SceneName,
    output: Output,
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
        Literal["direct", "gather", "surface"] | None, typer.Option(help="Light paths of this method, baked or not.")
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Say how far the scene's finest bake is from it, by both kinds of paths.")
    ] = False,
    data: Data = None,
) -> None:
    """Render by brute force: every texel of the light, visibility traced, paths between surfaces; nothing baked."""
    from rich.console import Console
    from rich.progress import Progress

    from cli.picture import check_output, check_shown, save
    from cli.truth.passes import find_baked, find_subject, sentences, traced
    from relume.errors import ParameterError

    check_output(output)
    if compare and (camera, size, method) != (None, None, None):
        raise ParameterError("--compare", "with --camera, --size or --method", "none of these: a bake has its own")
    if compare:
        subject = find_baked(data, scene, look, view)
    else:
        subject = find_subject(data, scene, look, view, camera, size, method, needs_bake=paths == "method")
    check_shown(output, subject.look)
    whose = paths if method is None else "method"
    with Progress(console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("reference", total=1.0)
        truth = traced(subject, spp, whose, lambda share: progress.update(bar, completed=share))
    save(output, truth.estimates[whose].mean, subject.look)
    for line in sentences(subject, truth, whose):
        typer.echo(line, err=not compare)
