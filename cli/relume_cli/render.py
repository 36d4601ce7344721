"""`relume render`: exact frames of a bake without a server."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from relume_cli.options import BakeName, Data, DryRun, View
from relume_cli.pictures.looks import Looks
from relume_cli.pictures.plans import TurntableSubject
from relume_cli.terminal.printing import Json, note, print_result

if TYPE_CHECKING:
    from relume_cli.pictures.files import ExrOptions
    from relume_cli.pictures.plans import PlannedFile, TurntablePlan
    from relume_cli.pictures.write_images import RenderSource
    from relume_worker.service import BakeService


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
        bool, typer.Option("--light-groups", help="EXR: layers of direct and of indirect light of each light instead.")
    ] = False,
    full_float: Annotated[bool, typer.Option("--float", help="EXR: full floats instead of half ones.")] = False,
    color_space: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="EXR: a linear color space of the config RELUME_OCIO. [default: Rec. 709]"),
    ] = None,
    turntable: Annotated[
        int | None,
        typer.Option(metavar="N", help="N frames once around: PNG files in a folder, or a video."),
    ] = None,
    rotate: Annotated[
        TurntableSubject | None,
        typer.Option(help="Turntable: what rotates: the camera, the object, or the environment. [default: camera]"),
    ] = None,
    fps: Annotated[int | None, typer.Option(min=1, max=120, help="Video: frames a second. [default: 25]")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Leave out what is written already.")] = False,
    approximate: Annotated[
        bool, typer.Option("--approximate", help="Free camera: the approximate image, as while moving.")
    ] = False,
    dry_run: DryRun = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Render exact frames of one look, of many, or all around.

    Prints the names of the files that were written.
    """
    from relume_cli.data_folder import open_bakes, open_settings
    from relume_cli.pictures.files import exr_options
    from relume_cli.pictures.looks import read_looks
    from relume_cli.pictures.plans import check_target, make_turntable_plan, plan_files
    from relume_server.persistence.look_store import LookStore

    turntable_plan = make_turntable_plan(turntable, rotate, fps)
    check_target(output, turntable_plan, resumes=resume)
    exr = exr_options(output, layers=layers, light_groups=light_groups, full_float=full_float, color_space=color_space)
    service = open_bakes(open_settings(data))
    try:
        planned_files = plan_files(read_looks(look or (), LookStore(service.ledger.sessions)), output, turntable_plan)
        source = _open(
            service,
            bake,
            view,
            is_free_camera=turntable_plan is not None and turntable_plan.subject != "environment",
            approximate=approximate,
        )
        documents = _check(source, planned_files, turntable_plan)
        if not dry_run:
            _write(source, planned_files, turntable_plan, exr, resumes=resume)
    finally:
        service.close()
    for planned_file, document in zip(planned_files, documents, strict=True):
        print_result(document | {"dry_run": dry_run}, str(planned_file.path), as_json=as_json)


def _check(
    source: RenderSource, planned_files: Sequence[PlannedFile], turntable_plan: TurntablePlan | None
) -> list[dict[str, Any]]:
    """What is written, as JSON. Raises ParameterError before anything is where a look, or the turntable, cannot be."""
    from relume_cli.pictures.plans import complete_plan
    from relume_cli.pictures.write_images import check_turntable

    view = source.transfer.views[source.view]
    looks = [complete_plan(planned_file, source.transfer.default_look) for planned_file in planned_files]
    if any(look.environment.map is not None for look in looks):
        note("note: shadows were baked before this light was known: small lamps' are less exact")
    if turntable_plan is not None:
        check_turntable(source, planned_files[0], turntable_plan)
    common = {"scene": source.scene.id, "bake": source.bake.id, "view": source.view, "size": [view.width, view.height]}
    frames = 1 if turntable_plan is None else turntable_plan.frames
    return [
        {"path": str(planned_file.path), "look": planned_file.look, **common, "frames": frames}
        for planned_file in planned_files
    ]


def _write(
    source: RenderSource,
    planned_files: Sequence[PlannedFile],
    turntable_plan: TurntablePlan | None,
    exr: ExrOptions,
    *,
    resumes: bool,
) -> None:
    """Paint all that is planned, and say how far it is."""
    from relume_cli.pictures.plans import complete_plan
    from relume_cli.pictures.write_images import write_picture, write_turntable
    from relume_cli.terminal.progress import progress, report_part

    with progress("render") as report:
        if turntable_plan is not None:
            write_turntable(source, planned_files[0], turntable_plan, report)
            return
        for number, planned_file in enumerate(planned_files):
            detail = f"{planned_file.look}, {number + 1} of {len(planned_files)}" if len(planned_files) > 1 else ""
            if not (resumes and planned_file.path.exists()):
                look = complete_plan(planned_file, source.transfer.default_look)
                write_picture(
                    source, look, planned_file.path, exr, report_part(report, number, len(planned_files), detail)
                )


def _open(
    service: BakeService, bake: str, view: str | None, *, is_free_camera: bool, approximate: bool
) -> RenderSource:
    """Open what was asked for, and say what its pictures are not."""
    from relume.core.cache import Cache
    from relume.methods.free_camera_transfer import BakedFreeCamera
    from relume.methods.registry import open_bake
    from relume.methods.static_view import StaticViewBuilder
    from relume_cli.data_folder import find_bake_and_view
    from relume_cli.pictures.write_images import RenderSource
    from relume_worker.storage import open_cached
    from relume_worker.tasks import load_registered_scene

    scene, bake_status, view_name = find_bake_and_view(service, bake, view, is_free_camera=is_free_camera)
    transfer = open_cached(service.store_path(bake_status.id), lambda store: open_bake(store, Cache(4 << 30)))
    if not bake_status.is_current:
        note(f"note: another version of relume made this bake; anew: relume bake {scene.id}")
    static_views = None
    if isinstance(transfer, BakedFreeCamera) and approximate:
        note("note: the image is approximate, as while the camera moves; exact without --approximate")
    elif isinstance(transfer, BakedFreeCamera):
        static_views = StaticViewBuilder(transfer.light_transport, load_registered_scene(service.data_dir, scene.id))
    return RenderSource(scene, bake_status, view_name, transfer, static_views)
