"""/api/renders: exact images of many looks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response
from fastapi.concurrency import run_in_threadpool

from relume import look as looks
from relume.core.errors import Description, NotFoundError, ParameterError
from relume.image_io.ocio.active_config import get_config
from relume.image_io.ocio.view import OcioView
from relume.live.fixed_camera.protocols import CameraMode, EditAxis, OpenBake
from relume.look.light_mix import expand_light_mix
from relume.output.exr.color_space import find_space
from relume.output.exr.layers import make_layers
from relume.store.bake_protocol import Recipe
from relume_server.api.bakes import plan_bake, queue_bake, require_ready_bake
from relume_server.api.job_lists import UserName, format_timestamps, list_jobs
from relume_server.api.pagination import PageDep
from relume_server.auth.roles import Caller, CallerDep
from relume_server.batch.batch_request import check_views, look_pointers, resolve_looks
from relume_server.batch.frame_sequence import (
    check_animation,
    crossed_material,
    look_at_frame,
    look_document_at_frame,
    with_pivot,
)
from relume_server.batch.image_names import label_images, name_images
from relume_server.batch.rebakes import recipe_for_size, use_bakes
from relume_server.batch.saved_views import read_saved_views, use_saved_views
from relume_server.io.downloads import Download, ZipStream
from relume_server.io.video import check_encoder
from relume_server.jobs.render_jobs import RenderJob, planned_bytes
from relume_server.openapi import files
from relume_server.schemas.base import MAX_NAME, Id, Name
from relume_server.schemas.bodies import RenderPlanBody
from relume_server.schemas.cameras import CameraFrame
from relume_server.schemas.protocol import MAX_CAMERA_PIXELS
from relume_server.schemas.renders import (
    MAX_FRAMES,
    MAX_LISTED_BYTES,
    MAX_LISTED_FRAMES,
    Keyframes,
    LooksBody,
    LooksRequest,
    QueuedRender,
    RenderBody,
    RenderFormat,
    RenderRequest,
)
from relume_server.services import Services, ServicesDep
from relume_worker.job_state import ACTIVE_STATES, JobState
from relume_worker.jobs.job import JobFilter, NotReadyError, new_id
from relume_worker.scenes import get_scene
from relume_worker.status import BakeStatus

Rebakes = Mapping[str, tuple[str, Recipe]]
router = APIRouter(prefix="/api/renders", tags=["renders"])
FrameIndex = Annotated[int, Path(ge=0, lt=MAX_FRAMES)]
MAX_WARNINGS = 20
MAX_LISTED_NAMES = 100  # of a dry run
MEDIA_TYPES = {"mp4": "video/mp4", "exr": "image/x-exr", "png": "image/png", "webp": "image/webp"}


@router.post("", status_code=202)
async def submit_render(
    request: RenderRequest, services: ServicesDep, caller: CallerDep, response: Response
) -> RenderBody | RenderPlanBody:
    """Queue a batch, or with `dry_run` return names and cost; all looks are validated first."""
    services.webhooks.check(request.webhook)
    queued, max_bytes = await _prepare(request, services)
    rebakes = await run_in_threadpool(_rebakes, queued, services)
    if request.dry_run:
        response.status_code = 200
        return await run_in_threadpool(_plan, queued, max_bytes, rebakes, services)
    identity = await run_in_threadpool(_queue, queued, max_bytes, rebakes, caller, services)
    response.headers["Location"] = f"/api/renders/{identity}"
    return await run_in_threadpool(lambda: _body(services.renders.get(identity), services))


async def _prepare(request: RenderRequest, services: Services) -> tuple[QueuedRender, int]:
    """Validate a request, and name its images.

    Returns:
        The batch, and an upper bound of the size of its files, bytes.
    """
    queued = await run_in_threadpool(resolve_looks, request, services.looks, services.settings.max_body_bytes)
    check_views(queued)
    if queued.saved_views:
        await run_in_threadpool(require_ready_bake, services, queued.bake)
        async with services.transfers.acquire(queued.bake, services.bakes.store_path(queued.bake)) as transfer:
            saved_views = await run_in_threadpool(read_saved_views, queued, services.looks)
            use_saved_views(queued, saved_views, transfer)
    scene_names, warnings, max_bytes = dict[str, str](), dict[str, None](), 0
    for bake in dict.fromkeys(bake for bake, _ in queued.bake_views):
        await run_in_threadpool(require_ready_bake, services, bake)
        async with services.transfers.acquire(bake, services.bakes.store_path(bake)) as transfer:
            for view in (view for each, view in queued.bake_views if each == bake):
                max_bytes += await run_in_threadpool(_check, queued, view, transfer)
            warnings.update(dict.fromkeys(_light_mix_warnings(queued, transfer)))
            scene = await run_in_threadpool(get_scene, services.bakes.ledger, transfer.scene_id)
            scene_names[bake] = scene.name
    queued.warnings = list(warnings)[:MAX_WARNINGS]
    if queued.name is None:
        view = "" if queued.saved_views else queued.view or ""
        queued.name = f"{scene_names[queued.bake_views[0][0]]} {view}".strip()[:MAX_NAME]
    queued.file_names = name_images(queued, scene_names)
    queued.labels = label_images(queued) if queued.format == "contact_sheet" else []
    return queued, max_bytes


def _rebakes(request: QueuedRender, services: Services) -> Rebakes:
    """Scene and recipe of each bake that a batch needs with another size, by the id of the one that it names."""
    statuses = [services.bakes.get(bake) for bake in dict.fromkeys(bake for bake, _ in request.bake_views)]
    recipes = [(status, recipe_for_size(status, request)) for status in statuses]
    return {status.id: (status.scene, recipe) for status, recipe in recipes if recipe is not None}


def _plan(request: QueuedRender, max_bytes: int, rebakes: Rebakes, services: Services) -> RenderPlanBody:
    plans = [plan_bake(scene, recipe, services) for scene, recipe in rebakes.values()]
    return RenderPlanBody(
        file_names=request.file_names[:MAX_LISTED_NAMES],
        total=request.num_images,
        bytes=max_bytes,
        warnings=request.warnings,
        bakes=[plan for plan in plans if not _is_ready(plan.id, services)],
    )


def _is_ready(bake: str, services: Services) -> bool:
    with suppress(NotFoundError):
        return services.bakes.get(bake).state == "ready"
    return False


def _light_mix_warnings(request: QueuedRender, transfer: OpenBake) -> list[str]:
    """Sentences about what the scene of a bake does not have of light mixes."""
    return [text for partial in request.looks for text in expand_light_mix(partial, transfer.default_look)[1]]


def _queue(request: QueuedRender, max_bytes: int, rebakes: Rebakes, caller: Caller, services: Services) -> str:
    """Queue a batch that takes at most so many bytes, and its bakes. Raises QuotaError, NearlyFullError, BusyError."""
    for scene, recipe in rebakes.values():
        queue_bake(scene, recipe, caller, services)
    use_bakes(request, rebakes)
    identity = new_id()
    with services.access.quotas.planned(caller.name, "render", identity, max_bytes):
        return services.renders.submit(request, caller.name, identity=identity)


@router.post("/looks")
async def frame_looks(request: LooksRequest, services: ServicesDep) -> LooksBody:
    """Look and camera of each frame of an animation, so that an editor plays exactly what will be rendered."""
    if request.num_frames > MAX_LISTED_FRAMES:
        raise ParameterError("frames", request.num_frames, f"at most {MAX_LISTED_FRAMES} frames for this call")
    await run_in_threadpool(require_ready_bake, services, request.bake)
    async with services.transfers.acquire(request.bake, services.bakes.store_path(request.bake)) as transfer:
        return await run_in_threadpool(_frame_looks, request, transfer)


def _frame_looks(request: LooksRequest, transfer: OpenBake) -> LooksBody:
    _check_looks(request, transfer)
    cameras = None if request.path is None else _path_cameras(request, transfer)
    request = with_pivot(request, transfer)
    num_chars, documents = 0, []
    for index in range(request.num_frames):
        documents.append(dict(look_document_at_frame(request, request.view, transfer, index)))
        num_chars += len(json.dumps(documents[-1]))
        if num_chars > MAX_LISTED_BYTES:
            raise ParameterError("frames", request.num_frames, f"at most {index} frames with looks of this size")
    crosses = None if request.view is None else crossed_material(request, request.view, transfer)
    return LooksBody(looks=documents, cameras=cameras, crosses=crosses)


def _path_cameras(request: LooksRequest, transfer: OpenBake) -> list[CameraFrame] | None:
    """Camera of each frame; None for the baked camera. Raises ParameterError if the bake does not allow it."""
    if request.view is None:
        raise ParameterError("view", None, "the view of the path")
    baked_view(request.view, transfer)
    cameras = [camera for camera in check_animation(request, request.view, transfer) if camera is not None]
    return [CameraFrame.from_camera(camera) for camera in cameras] or None


def _check_looks(request: Keyframes, transfer: OpenBake, pointers: Sequence[str] = ()) -> None:
    """Check keyframes. pointers: JSON pointers of the looks, if they are not all in `looks`. Raises ParameterError."""
    if len(request.looks) > request.num_frames:
        value = Description(f"a list of {len(request.looks)} looks")
        raise ParameterError("looks", value, f"at most one look per frame, {request.num_frames} in total")
    if request.durations is not None and len(request.durations) != len(request.looks) - 1:
        value = Description(f"a list of {len(request.durations)} durations")
        raise ParameterError("durations", value, f"{len(request.looks) - 1}, one from each look to the next")
    for index, partial in enumerate(request.looks):
        check_look(partial, transfer, pointers[index] if pointers else f"/looks/{index}")


def baked_view(name: str, transfer: OpenBake) -> Any:
    """Return the view of a bake by name. Raises ParameterError."""
    if name not in transfer.views:
        raise ParameterError("view", name, "one of " + ", ".join(transfer.views)[:400])
    return transfer.views[name]


def check_picture_size(size: tuple[int, int] | None) -> None:
    """Check the image size of a free camera; None: as baked. Raises ParameterError."""
    if size is not None and size[0] * size[1] > MAX_CAMERA_PIXELS:
        raise ParameterError("size", list(size), f"at most {MAX_CAMERA_PIXELS} pixels in total")


def check_look(partial: dict[str, Any], transfer: OpenBake, pointer: str) -> None:
    """Check a look at the JSON pointer `pointer`. Raises ParameterError."""
    try:
        looks.complete(partial, transfer.default_look)
    except ParameterError as error:
        raise ParameterError(f"{pointer}{error.name}", error.value, error.allowed) from None


def check_display(partial: dict[str, Any], pointer: str) -> None:
    """Check that this server can display images of a validated look at `pointer`. Raises ParameterError."""
    tone_map = partial.get("display", {}).get("tone_map")
    if not isinstance(tone_map, dict):
        return
    config = get_config()
    if config is None:
        allowed = "a built-in one, because this server has no OpenColorIO config (RELUME_OCIO)"
        raise ParameterError(f"{pointer}/display/tone_map", tone_map, allowed)
    try:
        config.check_view(OcioView(**tone_map))
    except ParameterError as error:
        raise ParameterError(f"{pointer}/display/tone_map", error.value, error.allowed) from None


def _check(request: QueuedRender, view_name: str, transfer: OpenBake) -> int:
    """Raise ParameterError if something cannot be rendered in a view.

    Returns:
        Upper bound of the size of its files, bytes.
    """
    view = baked_view(view_name, transfer)
    if request.format != "exr" and request.layers:
        raise ParameterError("layers", True, "false, because only EXR files have layers")
    if request.format != "exr" and request.aovs:
        raise ParameterError("aovs", True, "false, because only EXR files have AOVs")
    if request.format != "exr" and request.color_space is not None:
        raise ParameterError("color_space", request.color_space, "null, because only EXR files have a color space")
    find_space(request.color_space)
    if request.format == "mp4":
        check_encoder()
    if transfer.camera_mode is CameraMode.FREE:
        check_picture_size(request.size or (view.width, view.height))
    elif (
        not request.rebake
        and request.size is not None
        and (request.size[0] > view.width or request.size[1] > view.height)
    ):
        allowed = f"at most {view.width}×{view.height}, the baked size; rebake renders any size"
        raise ParameterError("size", list(request.size), allowed)
    pointers = look_pointers(request)
    _check_looks(request, transfer, pointers)
    if request.format != "exr":
        for pointer, partial in zip(pointers, request.looks, strict=True):
            check_display(partial, pointer)
    check_animation(request, view_name, transfer)
    look = look_at_frame(request, view_name, transfer, 0)
    layers = make_layers(request.layers, look, has_indirect=EditAxis.BOUNCES in transfer.axes)
    return planned_bytes(request, request.size or (view.width, view.height), 1 + len(layers))


@router.get("")
def list_renders(
    services: ServicesDep,
    page: PageDep,
    state: Annotated[JobState | None, Query()] = None,
    bake: Annotated[Id | None, Query()] = None,
    name: Annotated[Name | None, Query()] = None,
    user: Annotated[UserName | None, Query()] = None,
) -> list[RenderBody]:
    """List batches, newest first, filtered by state, bake, name or user; 100 without a `limit`."""
    job_filter = JobFilter(state, user, bake, name)
    return [_body(job, services) for job in list_jobs(services.renders, job_filter, page)]


@router.get("/{render}")
def get_render(render: Id, services: ServicesDep) -> RenderBody:
    """State and progress of a batch."""
    return _body(services.renders.get(render), services)


@router.delete("/{render}", status_code=204)
def delete_render(render: Id, services: ServicesDep) -> Response:
    """Stop a batch and delete its images; a bake that it waits for is canceled, and can be resumed."""
    waits_for = _unfinished_bakes(services.renders.get(render), services)
    services.renders.delete(render)
    for bake in waits_for:
        services.bakes.cancel(bake.id)
    services.access.quotas.disown("render", render)
    return Response(status_code=204)


@router.post("/{render}/resume", status_code=202)
def resume_render(render: Id, services: ServicesDep, caller: CallerDep) -> RenderBody:
    """Resume a failed batch, and a bake that it waits for; finished images are kept."""
    services.access.quotas.check_room()
    for bake in _unfinished_bakes(services.renders.get(render), services):
        queue_bake(bake.scene, bake.recipe, caller, services)
    services.renders.resume(render)
    return _body(services.renders.get(render), services)


@router.post("/{render}/frames/{index}/retry", status_code=202)
def retry_frame(render: Id, index: FrameIndex, services: ServicesDep) -> RenderBody:
    """Render one image of a ready or failed batch again, and all missing ones."""
    services.access.quotas.check_room()
    services.renders.retry(_job_with_frame(render, index, services), index)
    return _body(services.renders.get(render), services)


def _job_with_frame(identity: str, index: int, services: Services) -> RenderJob:
    job = services.renders.get(identity)
    if index >= job.total:
        raise NotFoundError(f"this batch has no frame {index}; choose from 0 to {job.total - 1}")
    return job


@router.get(
    "/{render}/frames/{index}",
    response_class=Download,
    name="get_frame",
    responses=files("image/x-exr", "image/png", "image/webp"),
)
def get_frame(render: Id, index: FrameIndex, services: ServicesDep) -> Download:
    """One finished image, numbered from 0."""
    job = _job_with_frame(render, index, services)
    path = services.renders.frame_path(job, index)
    if not path.exists():
        raise NotReadyError(f"frame {index} is not finished; {_state(job)}")
    name = services.renders.download_name(job, index)
    return Download(path, media_type=MEDIA_TYPES[job.request.picture_format], filename=name)


def _finished_job(identity: str, render_format: RenderFormat, services: Services) -> RenderJob:
    """A finished batch of a format that is one file. Raises NotFoundError, NotReadyError."""
    job = services.renders.get(identity)
    if job.request.format != render_format:
        raise NotFoundError(f"this batch has {job.request.format} images; submit one with format {render_format}")
    if job.state != "ready":
        raise NotReadyError(f"the batch is not finished; {_state(job)}")
    return job


@router.get("/{render}/video.mp4", response_class=Download, name="get_video", responses=files("video/mp4"))
def get_video(render: Id, services: ServicesDep) -> Download:
    """The finished batch as a video, if one was requested."""
    job = _finished_job(render, "mp4", services)
    path = services.renders.video_path(job)
    return Download(path, media_type=MEDIA_TYPES["mp4"], filename=services.renders.video_name(job))


@router.get(
    "/{render}/contact-sheet.png", response_class=Download, name="get_contact_sheet", responses=files("image/png")
)
def get_contact_sheet(render: Id, services: ServicesDep) -> Download:
    """The finished batch as one image with names, if one was requested."""
    job = _finished_job(render, "contact_sheet", services)
    path = services.renders.sheet_path(job)
    return Download(path, media_type="image/png", filename=services.renders.sheet_name(job))


@router.get("/{render}/archive.zip", response_class=Download, name="get_archive", responses=files("application/zip"))
def get_archive(render: Id, services: ServicesDep, partial: bool = False) -> Response:
    """All finished images in a ZIP; with `partial` before the batch is finished."""
    job = services.renders.get(render)
    if job.state != "ready":
        if not partial:
            raise NotReadyError(f"the batch is not finished; {_state(job)}; ?partial=true returns the finished frames")
        return _partial_archive(job, services)
    path = services.renders.archive_path(job)
    return Download(path, media_type="application/zip", filename=services.renders.archive_name(job))


def _partial_archive(job: RenderJob, services: Services) -> Response:
    missing = set(services.renders.missing(job))
    painted = [index for index in range(job.total) if index not in missing]
    if not painted:
        raise NotReadyError(f"no frame is finished; {_state(job)}")
    files = [(services.renders.frame_path(job, k), services.renders.download_name(job, k)) for k in painted]
    name = services.renders.archive_name(job).removesuffix(".zip") + "-partial.zip"
    return ZipStream(files, name)


def _state(job: RenderJob) -> str:
    if job.state == "failed":
        return f"it failed: {job.problem}"
    return f"it is {job.state}, try again later"


def _unfinished_bakes(job: RenderJob, services: Services) -> list[BakeStatus]:
    """Bakes that a batch started and waits for."""
    if not job.request.rebake:
        return []
    with suppress(NotFoundError):
        bakes = map(services.bakes.get, dict.fromkeys(bake for bake, _ in job.request.bake_views))
        return [status for status in bakes if status.state != "ready"]
    return []


def _body(job: RenderJob, services: Services) -> RenderBody:
    request = job.request
    waits_for = _unfinished_bakes(job, services) if job.state in ACTIVE_STATES else []
    baking = min((bake.progress for bake in waits_for), default=None)
    names = "bake", "view", "views", "name", "format", "size", "priority", "warnings"
    request_fields = {name: getattr(request, name) for name in names}
    return RenderBody.from_object(job, baking=baking, **request_fields, **format_timestamps(job))
