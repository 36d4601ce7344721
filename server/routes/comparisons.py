"""/api/truths: a frame against brute force, pass by pass."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.concurrency import run_in_threadpool

from relume.errors import ParameterError
from relume.picture.transfer import Eyes, Opened
from server.access.roles import Who
from server.apart.animation import compared_from
from server.errors import NotReadyError
from server.files.downloads import Download
from server.openapi import files
from server.queues.comparisons import Comparing
from server.queues.work import WorkFilter
from server.routes.bakes import ready_bake
from server.routes.paging import Paged
from server.routes.renders import baked_view, check_display, check_eye_size, check_look
from server.routes.works import UserName, moments, work_page
from server.services import Services, Shared
from server.wire.bodies import TruthBody, TruthPlanBody, TruthRequest
from server.wire.body import Id, WorkState

router = APIRouter(prefix="/api/truths", tags=["truths"])
Picture = Literal["error", "reference", "method-error", "method-reference"]


@router.post("", status_code=202, responses={200: {"model": TruthPlanBody, "description": "A dry run's answer"}})
async def submit_comparison(
    request: TruthRequest, services: Shared, caller: Who, response: Response
) -> TruthBody | TruthPlanBody:
    """Queue a comparison, or say how long it would take; the look is checked first."""
    await run_in_threadpool(ready_bake, services, request.bake)
    async with services.transfers.using(request.bake, services.bakes.store_path(request.bake)) as transfer:
        await run_in_threadpool(_check, request, transfer)
        if request.dry_run:
            response.status_code = 200
            _, (width, height) = compared_from(request, transfer)
            foreseen = await run_in_threadpool(services.comparisons.seconds, request, width * height)
            return TruthPlanBody(passes=request.passes, **foreseen._asdict())
    await run_in_threadpool(services.access.quotas.check_room)
    identity = await run_in_threadpool(services.comparisons.submit, request, caller.name)
    response.headers["Location"] = f"/api/truths/{identity}"
    return await run_in_threadpool(lambda: _body(services.comparisons.get(identity), services))


def _check(request: TruthRequest, transfer: Opened) -> None:
    baked_view(request.view, transfer)
    if transfer.eyes is Eyes.FREE:
        compared_from(request, transfer)
        check_eye_size(request.size)
    elif request.camera is not None or request.size is not None:
        able = "none for this bake, whose eye does not move: it is compared as it was baked"
        raise ParameterError("camera" if request.size is None else "size", "given", able)
    check_look(request.look, transfer, "/look")
    check_display(request.look, "/look")


@router.get("")
def list_comparisons(
    services: Shared,
    page: Paged,
    state: Annotated[WorkState | None, Query()] = None,
    bake: Annotated[Id | None, Query()] = None,
    user: Annotated[UserName | None, Query()] = None,
) -> list[TruthBody]:
    """Comparisons, newest first, those of a state, a bake or a user; 100 where no `limit` is given."""
    which = WorkFilter(state, user, bake)
    return [_body(comparing, services) for comparing in work_page(services.comparisons, which, page)]


@router.get("/{truth}")
def get_comparison(truth: Id, services: Shared) -> TruthBody:
    """State, progress, and what was found so far."""
    return _body(services.comparisons.get(truth), services)


@router.delete("/{truth}", status_code=204)
def stop_comparison(truth: Id, services: Shared, forget: bool = False) -> Response:
    """Stop a comparison; what was found so far is kept, unless `forget` says that nobody needs it."""
    (services.comparisons.delete if forget else services.comparisons.stop)(truth)
    return Response(status_code=204)


@router.post("/{truth}/resume", status_code=202)
def resume_comparison(truth: Id, services: Shared) -> TruthBody:
    """Go on with a comparison that was stopped or has failed, after its last finished pass."""
    services.comparisons.resume(truth)
    return _body(services.comparisons.get(truth), services)


@router.get(
    "/{truth}/{name}.png", response_class=Download,
    name="get_comparison_picture", responses=files("image/png"),
)
def get_picture(
    truth: Id, name: Picture, services: Shared, passes: Annotated[int | None, Query(ge=0)] = None
) -> Download:
    """Where the frame differs, or the brute force so far, by the paths that were asked for or by those that the bake's
    method follows. Brute force from the first pass on, where the frame differs from the second. `passes` only makes the
    address change when the picture does."""
    comparing = services.comparisons.get(truth)
    path = services.comparisons.picture_path(truth, name)
    if not path.exists():
        needed = "one pass is" if name.endswith("reference") else "two passes are"
        raise NotReadyError(f"{needed} needed, {comparing.done} are done; wait a little")
    return Download(path, media_type="image/png", headers={"Cache-Control": "no-store"})


def _body(comparing: Comparing, services: Services) -> TruthBody:
    request = comparing.request
    figures = dict(services.comparisons.figures(comparing.id))
    return TruthBody.of(
        comparing, bake=request.bake, view=request.view, paths=request.paths, passes=comparing.done,
        **moments(comparing), **figures,
    )  # fmt: skip
