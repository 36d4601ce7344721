"""`relume render`: exact frames of a bake without a server."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from cli.options import BakeName, Data, LookFile, View, read_look

if TYPE_CHECKING:
    from relume.exr.layers import Layering
    from relume.methods.stills import Stills
    from relume.picture.transfer import Opened
    from worker.scenes import SceneRecord
    from worker.service import BakeService
    from worker.status import BakeStatus

Turns = Literal["eye", "object", "environment"]
Output = Annotated[Path, typer.Option(metavar="FILE.exr|.png|.webp|DIR", help="Where to write the picture, or frames.")]


def render(
    bake: BakeName,
    output: Output,
    look: LookFile = None,
    view: View = None,
    layers: Annotated[bool, typer.Option("--layers", help="EXR: add a layer for each light and light path.")] = False,
    light_groups: Annotated[
        bool, typer.Option("--light-groups", help="EXR: layers of direct and of reflected light of each light instead.")
    ] = False,
    full_float: Annotated[bool, typer.Option("--float", help="EXR: full floats instead of half ones.")] = False,
    color_space: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="EXR: a linear colour space of the config RELUME_OCIO. [default: Rec. 709]"),
    ] = None,
    turntable: Annotated[
        int | None,
        typer.Option(metavar="N", help="N frames once around as PNG, of a moving bake, into a folder."),
    ] = None,
    turns: Annotated[
        Turns,
        typer.Option(help="Turntable: what turns; before an eye that stays, the object, or the environment alone."),
    ] = "eye",
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the frames that are in the folder.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Moving bakes: as it looks while the eye moves.")] = False,
    data: Data = None,
) -> None:
    """Render one exact frame of a bake, or a turntable."""
    from cli.data_folder import complete_look, open_bakes, open_settings
    from cli.picture import check_output, check_shown, save, save_exr
    from cli.turntable import check_frames, render_turntable
    from relume.errors import ParameterError
    from relume.exr.attributes import Origin
    from relume.render.image import render_image
    from server.wire.renders import Animation, Turntable

    if turntable is None:
        check_output(output)
    else:
        check_frames(output, turntable, resume)
    is_exr = turntable is None and output.suffix.lower() == ".exr"
    if (layers or light_groups or full_float or color_space) and not is_exr:
        raise ParameterError(
            "--output", output.name, "a file name that ends in .exr, for layers, --float, --color-space"
        )
    layering = _layering(layers, light_groups)
    partial = read_look(look)
    service = open_bakes(open_settings(data))
    try:
        is_moved = turntable is not None and turns != "environment"
        of = _open(service, bake, view, moves=is_moved, quick=quick)
        document = complete_look(partial, of.transfer.default_look)
        check_shown(output, document)
        if document.environment.map is not None:
            typer.echo("note: shadows were baked before this light was known: small lamps' are less exact", err=True)
        if turntable is not None:
            asked = Animation(bake=of.shown.id, looks=[partial], path=Turntable(turntable=turntable, turns=turns))
            render_turntable(of.transfer, of.view, asked, output, of.stills)
        elif is_exr:
            origin = Origin(of.scene.id, of.scene.name, of.shown.id)
            precision: Literal["half", "float"] = "float" if full_float else "half"
            save_exr(output, of.transfer, of.view, document, origin, layering, precision, of.stills, color_space)
        else:
            image = render_image(of.transfer, of.view, document, for_display=True, stills=of.stills)
            save(output, image, document)
    finally:
        service.close()


class _Shown(NamedTuple):
    """What is rendered: a bake of a scene, opened, one of its views, and what makes exact pictures of moved eyes."""

    scene: SceneRecord
    shown: BakeStatus
    view: str
    transfer: Opened
    stills: Stills | None


def _open(service: BakeService, bake: str, view: str | None, *, moves: bool, quick: bool) -> _Shown:
    """Open what was asked for, and say what its pictures are not."""
    from cli.data_folder import find_shown
    from relume.memory import Memory
    from relume.methods.moving_views import MovingViews
    from relume.methods.registry import open_bake
    from relume.methods.stills import Stills
    from worker.storage import open_kept
    from worker.tasks import scene_of

    scene, shown, view_name = find_shown(service, bake, view, moves=moves)
    transfer = open_kept(service.store_path(shown.id), lambda store: open_bake(store, Memory(4 << 30)))
    if not shown.is_current:
        typer.echo(f"note: another version of relume made this bake; anew: relume bake {scene.id}", err=True)
    stills = None
    if isinstance(transfer, MovingViews) and quick:
        typer.echo("note: the picture is approximate, as while the eye moves; exact: without --quick", err=True)
    elif isinstance(transfer, MovingViews):
        stills = Stills(transfer.lit, scene_of(service.data_dir, scene.id))
    return _Shown(scene, shown, view_name, transfer, stills)


def _layering(layers: bool, light_groups: bool) -> Layering:
    """Which layers are asked for, see `relume.exr.layers`. Raises ParameterError."""
    from relume.errors import ParameterError

    if layers and light_groups:
        raise ParameterError("--layers", "with --light-groups", "one of the two: each are the whole picture")
    return "light_groups" if light_groups else layers
