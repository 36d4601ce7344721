"""`relume render`: exact frames of a bake without a server."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.options import BakeName, Data, DryRun, View
from cli.pictures.looks import Looks
from cli.pictures.plans import Turns
from cli.terminal.printing import Json, note, print_result

if TYPE_CHECKING:
    from cli.pictures.files import ExrOptions
    from cli.pictures.painting import Shown
    from cli.pictures.plans import Planned, Turn
    from worker.service import BakeService


def render(
    bake: BakeName,
    output: Annotated[
        Path,
        typer.Option(
            metavar="FILE.exr|.png|.webp",
            help="Where to write the picture; of several looks with {look} in it, which stands for the name of each. "
            "Of a turntable: a folder, or FILE.mp4.",
        ),
    ],
    look: Looks = None,
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
        typer.Option(metavar="N", help="N frames once around: PNG files in a folder, or a video."),
    ] = None,
    turns: Annotated[
        Turns | None,
        typer.Option(help="Turntable: what turns; the eye, or before it the object, or the light. [default: eye]"),
    ] = None,
    fps: Annotated[int | None, typer.Option(min=1, max=120, help="Video: frames a second. [default: 25]")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Leave out what is written already.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Moving bakes: as it looks while the eye moves.")] = False,
    dry_run: DryRun = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Render exact frames of one look, of many, or all around.

    Prints the names of the files that were written.
    """
    from cli.data_folder import open_bakes, open_settings
    from cli.pictures.files import exr_options
    from cli.pictures.looks import read_looks
    from cli.pictures.plans import check_target, plan_files, turn_of
    from server.records.looks import LookStore

    turn = turn_of(turntable, turns, fps)
    check_target(output, turn, resumes=resume)
    exr = exr_options(output, layers=layers, light_groups=light_groups, full_float=full_float, color_space=color_space)
    service = open_bakes(open_settings(data))
    try:
        planned = plan_files(read_looks(look or (), LookStore(service.ledger.sessions)), output, turn)
        of = _open(service, bake, view, moves=turn is not None and turn.turns != "environment", quick=quick)
        documents = _check(of, planned, turn)
        if not dry_run:
            _write(of, planned, turn, exr, resumes=resume)
    finally:
        service.close()
    for one, document in zip(planned, documents, strict=True):
        print_result(document | {"dry_run": dry_run}, str(one.path), as_json=as_json)


def _check(of: Shown, planned: Sequence[Planned], turn: Turn | None) -> list[dict[str, Any]]:
    """What is written, as JSON. Raises ParameterError before anything is where a look, or the turntable, cannot be."""
    from cli.pictures.painting import check_turntable
    from cli.pictures.plans import complete_plan

    view = of.transfer.views[of.view]
    looks = [complete_plan(one, of.transfer.default_look) for one in planned]
    if any(look.environment.map is not None for look in looks):
        note("note: shadows were baked before this light was known: small lamps' are less exact")
    if turn is not None:
        check_turntable(of, planned[0], turn)
    about = {"scene": of.scene.id, "bake": of.bake.id, "view": of.view, "size": [view.width, view.height]}
    frames = 1 if turn is None else turn.frames
    return [{"path": str(one.path), "look": one.look, **about, "frames": frames} for one in planned]


def _write(of: Shown, planned: Sequence[Planned], turn: Turn | None, exr: ExrOptions, *, resumes: bool) -> None:
    """Paint all that is planned, and say how far it is."""
    from cli.pictures.painting import paint, paint_turntable
    from cli.pictures.plans import complete_plan
    from cli.terminal.progress import part_of, progress

    with progress("render") as tell:
        if turn is not None:
            paint_turntable(of, planned[0], turn, tell)
            return
        for number, one in enumerate(planned):
            words = f"{one.look}, {number + 1} of {len(planned)}" if len(planned) > 1 else ""
            if not (resumes and one.path.exists()):
                look = complete_plan(one, of.transfer.default_look)
                paint(of, look, one.path, exr, part_of(tell, number, len(planned), words))


def _open(service: BakeService, bake: str, view: str | None, *, moves: bool, quick: bool) -> Shown:
    """Open what was asked for, and say what its pictures are not."""
    from cli.data_folder import find_shown
    from cli.pictures.painting import Shown
    from relume.memory import Memory
    from relume.methods.moving_views import MovingViews
    from relume.methods.registry import open_bake
    from relume.methods.stills import Stills
    from worker.storage import open_kept
    from worker.tasks import scene_of

    scene, shown, view_name = find_shown(service, bake, view, moves=moves)
    transfer = open_kept(service.store_path(shown.id), lambda store: open_bake(store, Memory(4 << 30)))
    if not shown.is_current:
        note(f"note: another version of relume made this bake; anew: relume bake {scene.id}")
    stills = None
    if isinstance(transfer, MovingViews) and quick:
        note("note: the picture is approximate, as while the eye moves; exact: without --quick")
    elif isinstance(transfer, MovingViews):
        stills = Stills(transfer.lit, scene_of(service.data_dir, scene.id))
    return Shown(scene, shown, view_name, transfer, stills)
