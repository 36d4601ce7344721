"""`relume reference`: brute-force truth, for error figures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from cli.options import Data, LookFile, SceneName, Size, View, parse_size, read_camera, read_look
from cli.render import Output


def reference(
    scene: SceneName,
    output: Output,
    spp: Annotated[int, typer.Option(metavar="N", min=1, max=1 << 20, help="Samples per pixel.")],
    look: LookFile = None,
    view: View = None,
    camera: Annotated[Path | None, typer.Option(metavar="FILE.json", help="View from here instead.")] = None,
    size: Size = None,
    method: Annotated[
        Literal["direct", "gather"], typer.Option(help="Light as bakes of this method have it.")
    ] = "direct",
    data: Data = None,
) -> None:
    """Render by brute force: every texel of the light, visibility traced, paths between surfaces; nothing baked."""
    from rich.console import Console
    from rich.progress import Progress

    from cli.data_folder import complete_look, find_scene, open_bakes, open_settings
    from cli.picture import check_output, save
    from relume.errors import NotFoundError
    from relume.look import default_look
    from relume.reference import reference_image
    from relume.scene.placed_camera import with_cameras
    from worker.presets import PRESETS
    from worker.tasks import scene_of

    check_output(output)
    partial, pixels = read_look(look), parse_size(size) if size else PRESETS["good"].size
    service = open_bakes(open_settings(data))
    try:
        record = find_scene(service.ledger, scene)
    finally:
        service.close()
    if view is not None and view not in record.views:
        raise NotFoundError(f"the scene has no view {view[:80]!r}; its views are {', '.join(record.views)[:400]}")
    loaded, seen_from = scene_of(service.data_dir, record.id), view or record.views[0]
    if camera is not None:
        placed = read_camera(camera)
        loaded, seen_from = with_cameras(loaded, [placed.camera]), placed.name
    document = complete_look(partial, default_look(loaded.materials, loaded.lights))
    with Progress(console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("reference", total=1.0)
        image = reference_image(
            loaded,
            seen_from,
            document,
            pixels,
            spp,
            lambda fraction: progress.update(bar, completed=fraction),
            reflects=method == "gather",
        )
    save(output, image, document)
