"""Queue a render for the server of the data directory, and do not wait for it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.core.errors import ParameterError
from relume.output.file_names import parse_portable_template
from relume_cli.pictures.files import FORMATS

if TYPE_CHECKING:
    from relume_cli.pictures.files import ExrOptions
    from relume_cli.pictures.looks import NamedLook
    from relume_cli.pictures.plans import AnimationPlan
    from relume_cli.pictures.write_images import RenderSource
    from relume_server.jobs.render_jobs import RenderJobs
    from relume_server.schemas.renders import QueuedRender
    from relume_worker.service import BakeService


def check_queueable(output: Path, contact_sheet: Path | None, *, resumes: bool) -> None:
    """Raise ParameterError if an option needs files that a queued render does not write."""
    if output.name != str(output):
        allowed = "a file name without folders with --no-wait; the server stores the images"
        raise ParameterError("--output", str(output), allowed)
    suffix = output.suffix.lower()
    parse_portable_template("--output", _template(output), suffix if suffix in FORMATS else ".png")
    if contact_sheet is not None:
        raise ParameterError("--contact-sheet", str(contact_sheet), "it without --no-wait")
    if resumes:
        raise ParameterError("--resume", True, "it without --no-wait")


def queue_render(
    service: BakeService,
    source: RenderSource,
    looks: Sequence[NamedLook],
    views: Sequence[str],
    output: Path,
    animation_plan: AnimationPlan | None,
    exr: ExrOptions,
    sets: QueuedRender | None,
    *,
    start: int,
    approximate: bool,
) -> dict[str, Any]:
    """Queue a checked render as POST /api/renders does; `sets`: the looks in their own views, if they are.

    Returns:
        The job as JSON.
    Raises:
        ParameterError: file names are not portable. BusyError, QuotaError: too many renders are unfinished.
    """
    from relume_server.batch.batch_request import check_views
    from relume_server.batch.image_names import name_images
    from relume_server.jobs.render_jobs import RenderJobs
    from relume_server.schemas.renders import QueuedRender

    fields = _fields(source, looks, views, output, exr) | _animation_fields(animation_plan)
    quality = "interactive" if approximate else "exact"
    queued = QueuedRender.model_validate({**fields, "start_frame": start, "quality": quality})
    check_views(queued)
    if sets is not None:
        queued.view, queued.views = sets.view, []
        queued.saved_views, queued.look_views, queued.path = True, sets.look_views, sets.path
    queued.file_names = name_images(queued, {source.bake.id: source.scene.name})
    renders = RenderJobs(service.jobs, service.data_dir, lambda bake: source.scene.name, service.get, lambda *_: None)
    identity = renders.submit(queued)
    return {
        "id": identity,
        "state": "queued",
        "total": queued.num_images,
        "files": _packed_file(queued, renders, identity),
    }


def _packed_file(request: QueuedRender, renders: RenderJobs, identity: str) -> str:
    """File that has all images when the render is ready."""
    job = renders.get(identity)
    return str(renders.video_path(job) if request.format == "mp4" else renders.archive_path(job))


def _fields(
    source: RenderSource, looks: Sequence[NamedLook], views: Sequence[str], output: Path, exr: ExrOptions
) -> dict[str, Any]:
    return {
        "bake": source.bake.id,
        "views": [{"view": view} for view in views],
        "looks": [look.document for look in looks],
        "look_names": [look.name for look in looks],
        "name": output.stem,
        "file_name": _template(output),
        "format": output.suffix.lower().removeprefix(".") or "png",
        "layers": exr.layering,
        "aovs": exr.aovs,
        "precision": exr.precision,
        "color_space": exr.color_space,
    }


def _template(output: Path) -> str:
    """Name of each image; those of a folder or a video are numbered."""
    return output.name if output.suffix.lower() in FORMATS else f"{output.stem}.{{frame:04}}"


def _animation_fields(plan: AnimationPlan | None) -> dict[str, Any]:
    if plan is None:
        return {}
    fields = {"fps": plan.fps, "frame_step": plan.step, "interpolation": plan.interpolation}
    if plan.subject is None:
        return {**fields, "frames": plan.frames}
    return {**fields, "path": {"turntable": plan.frames, "rotate": plan.subject}}
