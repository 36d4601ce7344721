"""/api/renders: exact pictures of many looks at once."""

from __future__ import annotations

import json
import math
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response
from fastapi.concurrency import run_in_threadpool

from relume import look as looks
from relume.errors import NotFoundError, ParameterError
from relume.exr.layers import layers_for
from relume.exr.space import space_called
from relume.imageio.ocio.current import current
from relume.imageio.ocio.view import OcioView
from relume.picture.transfer import Axis, Eyes, Opened
from server.access.roles import Caller, Who
from server.apart.animation import check_animation, document_of, look_of, with_pivot
from server.errors import NotReadyError
from server.files.downloads import Download, ZipStream
from server.files.video import check_encoder
from server.openapi import files
from server.queues.renders import Render, planned_bytes
from server.queues.work import WorkFilter, new_id
from server.routes.bakes import ready_bake
from server.routes.paging import Paged
from server.routes.works import UserName, moments, work_page
from server.services import Services, Shared
from server.wire.body import MAX_NAME, Id, Name, WorkState
from server.wire.cameras import CameraFrame
from server.wire.protocol import MAX_EYE_PIXELS
from server.wire.renders import (
    MAX_FRAMES,
    MAX_TOLD,
    MAX_TOLD_BYTES,
    Keyframes,
    LooksBody,
    LooksRequest,
    RenderBody,
    RenderRequest,
)
from worker.scenes import get_scene

router = APIRouter(prefix="/api/renders", tags=["renders"])
FrameIndex = Annotated[int, Path(ge=0, lt=MAX_FRAMES)]
MEDIA_TYPES = {"mp4": "video/mp4", "exr": "image/x-exr", "png": "image/png", "webp": "image/webp"}


@router.post("", status_code=202)
async def submit_render(request: RenderRequest, services: Shared, caller: Who, response: Response) -> RenderBody:
    """Queue a batch; every look is checked first."""
    await run_in_threadpool(ready_bake, services, request.bake)
    async with services.transfers.using(request.bake, services.bakes.store_path(request.bake)) as transfer:
        most_bytes = await run_in_threadpool(_check, request, transfer)
        if request.name is None:
            scene = await run_in_threadpool(get_scene, services.bakes.ledger, transfer.scene_id)
            request.name = f"{scene.name} {request.view}"[:MAX_NAME]
    identity = await run_in_threadpool(_queue, request, most_bytes, caller, services)
    response.headers["Location"] = f"/api/renders/{identity}"
    return _body(await run_in_threadpool(services.renders.get, identity))


def _queue(request: RenderRequest, most_bytes: int, caller: Caller, services: Services) -> str:
    """Queue a batch that takes at most so many bytes of whoever asks. Raises QuotaError, BusyError."""
    quotas = services.access.quotas
    with quotas.deciding:
        quotas.check_bytes(caller.name, most_bytes)
        identity = new_id()
        with quotas.owning(caller.name, "render", identity, most_bytes):
            return services.renders.submit(request, caller.name, identity=identity)


@router.post("/looks")
async def frame_looks(request: LooksRequest, services: Shared) -> LooksBody:
    """What each frame of a batch with these keyframes shows, and from where: an editor plays what will be rendered."""
    if request.num_frames > MAX_TOLD:
        raise ParameterError("frames", request.num_frames, f"at most {MAX_TOLD} to be looked at")
    await run_in_threadpool(ready_bake, services, request.bake)
    async with services.transfers.using(request.bake, services.bakes.store_path(request.bake)) as transfer:
        return await run_in_threadpool(_frame_looks, request, transfer)


def _frame_looks(request: LooksRequest, transfer: Opened) -> LooksBody:
    _check_looks(request, transfer)
    cameras = None if request.path is None else _told_way(request, transfer)
    request = with_pivot(request, transfer)
    size, found = 0, []
    for index in range(request.num_frames):
        found.append(dict(document_of(request, request.view, transfer, index)))
        size += len(json.dumps(found[-1]))
        if size > MAX_TOLD_BYTES:
            raise ParameterError("frames", request.num_frames, f"at most {index} of looks as large as these")
    return LooksBody(looks=found, cameras=cameras)


def _told_way(request: LooksRequest, transfer: Opened) -> list[CameraFrame] | None:
    """Where each frame is seen from; None where it was baked. Raises ParameterError where no eye can go there."""
    if request.view is None:
        raise ParameterError("view", None, "the view that the path is a way of")
    baked_view(request.view, transfer)
    eyes = [eye for eye in check_animation(request, request.view, transfer) if eye is not None]
    return [CameraFrame(to_world=eye.to_world.ravel().tolist(), yfov=math.degrees(eye.yfov)) for eye in eyes] or None


def _check_looks(request: Keyframes, transfer: Opened) -> None:
    if len(request.looks) > request.num_frames:
        few = f"at most as many as frames, {request.num_frames}"
        raise ParameterError("looks", f"{len(request.looks)} keyframes", few)
    for index, partial in enumerate(request.looks):
        check_look(partial, transfer, f"/looks/{index}")


def baked_view(name: str, transfer: Opened) -> Any:
    """A view of a bake that a body names. Raises ParameterError."""
    if name not in transfer.views:
        raise ParameterError("view", name, "one of " + ", ".join(transfer.views)[:400])
    return transfer.views[name]


def check_eye_size(size: tuple[int, int] | None) -> None:
    """Whether pictures of a moving eye may be so large; None: as baked. Raises ParameterError."""
    if size is not None and size[0] * size[1] > MAX_EYE_PIXELS:
        raise ParameterError("size", list(size), f"at most {MAX_EYE_PIXELS} pixels in all")


def check_look(partial: dict[str, Any], transfer: Opened, pointer: str) -> None:
    """A look that stands at `pointer` of a body. Raises ParameterError."""
    try:
        looks.complete(partial, transfer.default_look)
    except ParameterError as error:
        raise ParameterError(f"{pointer}{error.name}", error.value, error.allowed) from None


def check_display(partial: dict[str, Any], pointer: str) -> None:
    """Whether pictures of a checked look, at `pointer` of a body, can be shown here. Raises ParameterError."""
    tone_map = partial.get("display", {}).get("tone_map")
    if not isinstance(tone_map, dict):
        return
    config = current()
    if config is None:
        able = "one of relume's own: there is no OpenColorIO config here (RELUME_OCIO)"
        raise ParameterError(f"{pointer}/display/tone_map", tone_map, able)
    try:
        config.check_view(OcioView(**tone_map))
    except ParameterError as error:
        raise ParameterError(f"{pointer}/display/tone_map", error.value, error.allowed) from None


def _check(request: RenderRequest, transfer: Opened) -> int:
    """Raises ParameterError where something cannot be rendered.

    Returns:
        What its files take at most, bytes.
    """
    view = baked_view(request.view, transfer)
    if request.format != "exr" and request.layers:
        raise ParameterError("layers", True, "false for this format; only EXR files have layers")
    if request.format != "exr" and request.color_space is not None:
        raise ParameterError("color_space", request.color_space, "null for this format, whose looks have a tone map")
    space_called(request.color_space)
    if request.format == "mp4":
        check_encoder()
    if transfer.eyes is Eyes.FREE:
        check_eye_size(request.size or (view.width, view.height))
    elif request.size is not None and (request.size[0] > view.width or request.size[1] > view.height):
        baked = f"at most {view.width}×{view.height}, the baked size; bake a larger one for more"
        raise ParameterError("size", list(request.size), baked)
    _check_looks(request, transfer)
    if request.format != "exr":
        for index, partial in enumerate(request.looks):
            check_display(partial, f"/looks/{index}")
    check_animation(request, request.view, transfer)
    look = look_of(request, request.view, transfer, 0)
    layers = layers_for(request.layers, look, reflects=Axis.BOUNCES in transfer.axes)
    return planned_bytes(request, request.size or (view.width, view.height), 1 + len(layers))


@router.get("")
def list_renders(
    services: Shared,
    page: Paged,
    state: Annotated[WorkState | None, Query()] = None,
    bake: Annotated[Id | None, Query()] = None,
    name: Annotated[Name | None, Query()] = None,
    user: Annotated[UserName | None, Query()] = None,
) -> list[RenderBody]:
    """Batches, newest first, those of a state, a bake, a name or a user; 100 where no `limit` is given."""
    which = WorkFilter(state, user, bake, name)
    return [_body(render) for render in work_page(services.renders, which, page)]


@router.get("/{render}")
def get_render(render: Id, services: Shared) -> RenderBody:
    """State and progress."""
    return _body(services.renders.get(render))


@router.delete("/{render}", status_code=204)
def delete_render(render: Id, services: Shared) -> Response:
    """Stop a batch and forget its pictures."""
    services.renders.delete(render)
    services.access.quotas.disown("render", render)
    return Response(status_code=204)


@router.post("/{render}/resume", status_code=202)
def resume_render(render: Id, services: Shared) -> RenderBody:
    """Go on with a batch that has failed; pictures that are there stay."""
    services.access.quotas.check_room()
    services.renders.resume(render)
    return _body(services.renders.get(render))


@router.post("/{render}/frames/{index}/retry", status_code=202)
def retry_frame(render: Id, index: FrameIndex, services: Shared) -> RenderBody:
    """Paint one picture of a batch that is ready or has failed again, and what else is missing."""
    services.access.quotas.check_room()
    services.renders.retry(_with_frame(render, index, services), index)
    return _body(services.renders.get(render))


def _with_frame(identity: str, index: int, services: Services) -> Render:
    render = services.renders.get(identity)
    if index >= render.total:
        raise NotFoundError(f"this batch has {render.total} frames, counted from 0")
    return render


@router.get(
    "/{render}/frames/{index}", response_class=Download,
    name="get_frame", responses=files("image/x-exr", "image/png", "image/webp"),
)
def get_frame(render: Id, index: FrameIndex, services: Shared) -> Download:
    """One finished picture, counted from 0."""
    found = _with_frame(render, index, services)
    path = services.renders.frame_path(found, index)
    if not path.exists():
        raise NotReadyError(f"frame {index} is not finished; {_state(found)}")
    name = services.renders.download_name(found, index)
    return Download(path, media_type=MEDIA_TYPES[found.request.picture_format], filename=name)


@router.get("/{render}/video.mp4", response_class=Download, name="get_video", responses=files("video/mp4"))
def get_video(render: Id, services: Shared) -> Download:
    """All pictures as a video, where one was asked for, when it is finished."""
    found = services.renders.get(render)
    if found.request.format != "mp4":
        raise NotFoundError(f"this batch has {found.request.format} pictures; ask for the format mp4")
    if found.state != "ready":
        raise NotReadyError(f"the batch is not finished; {_state(found)}")
    path = services.renders.video_path(found)
    return Download(path, media_type=MEDIA_TYPES["mp4"], filename=services.renders.video_name(found))


@router.get("/{render}/archive.zip", response_class=Download, name="get_archive", responses=files("application/zip"))
def get_archive(render: Id, services: Shared, partial: bool = False) -> Response:
    """All pictures in one file, when all are finished; with `partial` those that are, before."""
    found = services.renders.get(render)
    if found.state != "ready":
        if not partial:
            raise NotReadyError(f"the batch is not finished; {_state(found)}; ?partial=true has what is there")
        return _partial_archive(found, services)
    path = services.renders.archive_path(found)
    return Download(path, media_type="application/zip", filename=services.renders.archive_name(found))


def _partial_archive(found: Render, services: Services) -> Response:
    missing = set(services.renders.missing(found))
    painted = [index for index in range(found.total) if index not in missing]
    if not painted:
        raise NotReadyError(f"no frame is finished; {_state(found)}")
    files = [(services.renders.frame_path(found, k), services.renders.download_name(found, k)) for k in painted]
    name = services.renders.archive_name(found).removesuffix(".zip") + "-partial.zip"
    return ZipStream(files, name)


def _state(found: Render) -> str:
    if found.state == "failed":
        return f"it failed: {found.problem}"
    return f"it is {found.state}, wait a little"


def _body(render: Render) -> RenderBody:
    request = render.request
    asked = {name: getattr(request, name) for name in ("bake", "view", "name", "format", "size")}
    return RenderBody.of(render, **asked, **moments(render))
