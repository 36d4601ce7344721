"""`relume render`: render exact images of a bake without a server."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from relume_cli.options import BakeName, Data, DryRun
from relume_cli.pictures.looks import Looks
from relume_cli.pictures.plans import Between, TurntableSubject
from relume_cli.terminal.printing import Json, note, print_result

if TYPE_CHECKING:
    from relume.scene.model import Scene
    from relume_cli.pictures.files import ExrOptions
    from relume_cli.pictures.plans import AnimationPlan, PlannedFile
    from relume_cli.pictures.write_images import RenderSource
    from relume_worker.service import BakeService


def render(
    bake: BakeName,
    output: Annotated[
        Path,
        typer.Option(
            metavar="FILE.exr|.png|.webp",
            help="Image file to write; {look}, {view}, {scene}, {bake} and {frame:04} in its name stand for those of "
            "each image. Turntable or animation: a name with {frame}, a folder, or FILE.mp4.",
        ),
    ],
    look: Looks = None,
    view: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="View; repeat for several. [default: the first]")
    ] = None,
    saved_views: Annotated[
        bool, typer.Option("--saved-views", help="Render each saved look in the view saved with it.")
    ] = False,
    all_sets: Annotated[
        bool, typer.Option("--all-sets", help="Render all saved looks that have a view, each in its view.")
    ] = False,
    layers: Annotated[bool, typer.Option("--layers", help="EXR: add one layer per light and per light path.")] = False,
    light_groups: Annotated[
        bool, typer.Option("--light-groups", help="EXR: add direct and indirect layers per light.")
    ] = False,
    aovs: Annotated[bool, typer.Option("--aovs", help="EXR: add depth, normals and others, and Cryptomattes.")] = False,
    full_float: Annotated[bool, typer.Option("--float", help="EXR: 32-bit floats instead of 16-bit.")] = False,
    color_space: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="EXR: linear color space of the OpenColorIO config (RELUME_OCIO). [default: Rec. 709]"
        ),
    ] = None,
    turntable: Annotated[
        int | None, typer.Option(metavar="N", help="Render N frames of a turntable: PNG files in a folder, or a video.")
    ] = None,
    rotate: Annotated[
        TurntableSubject | None,
        typer.Option(help="Turntable: rotate the camera, the object, or the environment. [default: camera]"),
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option(metavar="N", help="Render N frames from look to look: PNG files in a folder, or a video."),
    ] = None,
    between: Annotated[
        Between | None,
        typer.Option(
            help="Animation: interpolate materials straight by their parameters, or across the map of Ngan's or Löw's "
            "fits. [default: straight]"
        ),
    ] = None,
    fps: Annotated[int | None, typer.Option(min=1, max=120, help="Video: frames per second. [default: 25]")] = None,
    start: Annotated[int, typer.Option(metavar="N", min=0, max=10**8, help="Number of the first frame.")] = 0,
    step: Annotated[
        int | None, typer.Option(metavar="N", min=1, max=3600, help="Animation: render only every N-th frame.")
    ] = None,
    contact_sheet: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Also write one PNG with all images and their names.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Skip files that exist.")] = False,
    approximate: Annotated[
        bool, typer.Option("--approximate", help="Free camera: render the approximate image shown while it moves.")
    ] = False,
    wait: Annotated[
        bool, typer.Option(help="Render here; --no-wait queues the render for a running server, and prints its id.")
    ] = True,
    dry_run: DryRun = False,
    as_json: Json = False,
    data: Data = None,
) -> None:
    """Render exact images, turntables, or animations of looks.

    Prints the names of the written files, or the id of a queued render.
    """
    from relume.output.file_names import FileFields
    from relume_cli.data_folder import open_bakes, open_settings
    from relume_cli.pictures.files import exr_options
    from relume_cli.pictures.looks import read_looks, read_sets
    from relume_cli.pictures.plans import check_frames, check_keyframes, check_target, make_animation_plan, plan_files
    from relume_cli.pictures.queue_render import check_queueable, queue_render
    from relume_cli.pictures.sets import check_sets, plan_sets, resolve_sets, select_sets
    from relume_cli.pictures.write_sheet import check_sheet, write_sheet
    from relume_server.persistence.look_store import LookStore

    animation_plan = make_animation_plan(turntable, rotate, frames, between, fps, step)
    check_sets(look, view, animation_plan, saved_views=saved_views, all_sets=all_sets)
    check_target(output, animation_plan)
    if not wait:
        check_queueable(output, contact_sheet, resumes=resume)
    exr = exr_options(
        output,
        layers=layers,
        light_groups=light_groups,
        aovs=aovs,
        full_float=full_float,
        color_space=color_space,
    )
    service = open_bakes(open_settings(data))
    try:
        look_store = LookStore(service.ledger.sessions)
        named_looks = read_sets(look_store) if all_sets else read_looks(look or (), look_store)
        if animation_plan is not None:
            check_keyframes(len(named_looks), animation_plan)
        source, views = _open(
            service,
            bake,
            view or (),
            is_free_camera=animation_plan is not None and animation_plan.subject in ("camera", "object"),
            approximate=approximate,
        )
        if all_sets:
            named_looks = select_sets(source, named_looks)
        fields = FileFields(source.scene.name, source.bake.id, source.view, "", start)
        sets = resolve_sets(source, named_looks) if saved_views or all_sets else None
        if sets is None:
            planned_files = plan_files(named_looks, output, animation_plan, fields, views)
        else:
            planned_files = plan_sets(source, sets, output, fields)
        for planned_file in planned_files if animation_plan is not None and wait else ():
            check_frames(planned_file, resumes=resume)
        check_sheet(contact_sheet, planned_files)
        documents = _check(source, planned_files, animation_plan)
        if not (wait or dry_run):
            job = queue_render(
                service,
                source,
                named_looks,
                views,
                output,
                animation_plan,
                exr,
                sets,
                start=start,
                approximate=approximate,
            )
            print_result(job, job["id"], as_json=as_json, details=_follow_lines(job))
            return
        if not dry_run:
            _write(source, planned_files, animation_plan, exr, resumes=resume)
            write_sheet(contact_sheet, planned_files)
    finally:
        service.close()
    for planned_file, document in zip(planned_files, documents, strict=True):
        print_result(document | {"dry_run": dry_run}, str(planned_file.path), as_json=as_json)


def _follow_lines(job: dict[str, Any]) -> list[str]:
    return [
        f"queued for the server of this data directory; follow it: relume status {job['id']}",
        f"when it is ready, all images are in {job['files']}",
    ]


def _check(
    source: RenderSource, planned_files: Sequence[PlannedFile], animation_plan: AnimationPlan | None
) -> list[dict[str, Any]]:
    """Return the files to write, as JSON. Raises ParameterError if a look or the animation is invalid."""
    from relume.look.light_mix import expand_light_mix
    from relume_cli.pictures.plans import complete_plan
    from relume_cli.pictures.write_images import check_animation_plan
    from relume_server.batch.frame_sequence import crossed_material

    default = source.transfer.default_look
    looks = [look for planned_file in planned_files for look in complete_plan(planned_file, default)]
    if any(look.environment.map is not None for look in looks):
        note("note: this environment was not baked, so shadows of small light sources are approximate")
    mixes = (expand_light_mix(each, default)[1] for planned_file in planned_files for each in planned_file.documents)
    for warning in dict.fromkeys(warning for mix in mixes for warning in mix):
        note(f"warning: {warning}")
    if animation_plan is not None:
        for planned_file in planned_files:
            view_source = source._replace(view=planned_file.view)
            animation, _ = check_animation_plan(view_source, planned_file, animation_plan)
            if (material := crossed_material(animation, planned_file.view, source.transfer)) is not None:
                note(f"note: the turntable passes through {material!r}; frames behind it show it from outside")
    common = {"scene": source.scene.id, "bake": source.bake.id}
    return [
        {
            "path": str(planned_file.path),
            "look": planned_file.look,
            **common,
            "view": planned_file.view,
            "size": [source.transfer.views[planned_file.view].width, source.transfer.views[planned_file.view].height],
            "frames": max(1, len(planned_file.frames)),
        }
        for planned_file in planned_files
    ]


def _write(
    source: RenderSource,
    planned_files: Sequence[PlannedFile],
    animation_plan: AnimationPlan | None,
    exr: ExrOptions,
    *,
    resumes: bool,
) -> None:
    """Render all planned files, with progress."""
    from relume_cli.pictures.plans import complete_plan
    from relume_cli.pictures.write_images import write_animation, write_picture
    from relume_cli.terminal.progress import progress, report_part

    with progress("render") as report:
        for number, planned_file in enumerate(planned_files):
            view_source = source._replace(view=planned_file.view)
            detail = f"{planned_file.look}, {number + 1} of {len(planned_files)}" if len(planned_files) > 1 else ""
            report_file = report_part(report, number, len(planned_files), detail)
            if animation_plan is not None:
                write_animation(view_source, planned_file, animation_plan, exr, report_file)
            elif not (resumes and planned_file.path.exists()):
                (look,) = complete_plan(planned_file, source.transfer.default_look)
                write_picture(view_source, look, planned_file.path, exr, report_file, planned_file.camera)


def _open(
    service: BakeService, bake: str, views: Sequence[str], *, is_free_camera: bool, approximate: bool
) -> tuple[RenderSource, list[str]]:
    """Open a bake with all views, and note the limits of its images; return it with the names of the views."""
    from relume.core.cache import Cache
    from relume.live.opened.free_camera_transfer import BakedFreeCamera
    from relume.live.opened.openers import open_bake
    from relume.live.opened.static_view import StaticViewBuilder
    from relume_cli.data_folder import find_bake_and_view
    from relume_cli.pictures.write_images import RenderSource
    from relume_worker.storage import open_cached
    from relume_worker.tasks import load_registered_scene

    first, *others = views or (None,)
    scene, bake_status, view_name = find_bake_and_view(service, bake, first, is_free_camera=is_free_camera)
    view_names = [view_name, *(find_bake_and_view(service, bake_status.id, other)[2] for other in others)]
    transfer = open_cached(service.store_path(bake_status.id), lambda store: open_bake(store, Cache(4 << 30)))
    if not bake_status.is_current:
        note(f"note: another version of relume made this bake; update it: relume bake {scene.id}")
    is_approximate = isinstance(transfer, BakedFreeCamera) and approximate
    if is_approximate:
        note("note: --approximate renders the image shown while the camera moves; leave it out for the exact one")

    @cache
    def load_scene() -> Scene:
        return load_registered_scene(service.data_dir, scene.id)

    @cache
    def find_static_views() -> StaticViewBuilder:
        return StaticViewBuilder.from_bake(transfer, load_scene())

    find_views = None if is_approximate else find_static_views
    return RenderSource(scene, bake_status, view_name, transfer, load_scene, find_views), view_names
