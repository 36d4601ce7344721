"""/api/comparisons: compare a frame with the reference, pass by pass."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from fastapi.concurrency import run_in_threadpool

from relume.core.errors import Description, ParameterError
from relume.live.fixed_camera.protocols import CameraMode, OpenBake
from relume_server.api.bakes import require_ready_bake
from relume_server.api.job_lists import UserName, format_timestamps, list_jobs
from relume_server.api.pagination import PageDep
from relume_server.api.renders import baked_view, check_display, check_look, check_picture_size
from relume_server.auth.roles import Caller, CallerDep
from relume_server.batch.frame_sequence import comparison_camera
from relume_server.io.downloads import Download
from relume_server.jobs.comparison_jobs import ComparisonJob, planned_bytes
from relume_server.openapi import files
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import ComparisonBody, ComparisonPlanBody, ComparisonRequest
from relume_server.services import Services, ServicesDep
from relume_worker.job_state import JobState
from relume_worker.jobs.job import JobFilter, NotReadyError, new_id

router = APIRouter(prefix="/api/comparisons", tags=["comparisons"])
Picture = Literal["error", "reference", "method-error", "method-reference"]


@router.post(
    "", status_code=202, responses={200: {"model": ComparisonPlanBody, "description": "Response to a dry run"}}
)
async def submit_comparison(
    request: ComparisonRequest, services: ServicesDep, caller: CallerDep, response: Response
) -> ComparisonBody | ComparisonPlanBody:
    """Queue a comparison, or with `dry_run` return its duration; the look is validated first."""
    await run_in_threadpool(require_ready_bake, services, request.bake)
    async with services.transfers.acquire(request.bake, services.bakes.store_path(request.bake)) as transfer:
        await run_in_threadpool(_check, request, transfer)
        _, size = comparison_camera(request, transfer)
        if request.dry_run:
            response.status_code = 200
            foreseen = await run_in_threadpool(services.comparisons.estimate_duration, request, size[0] * size[1])
            return ComparisonPlanBody(passes=request.passes, **foreseen._asdict())
    identity = await run_in_threadpool(_queue, request, planned_bytes(request, size), caller, services)
    response.headers["Location"] = f"/api/comparisons/{identity}"
    return await run_in_threadpool(lambda: _body(services.comparisons.get(identity), services))


def _queue(request: ComparisonRequest, max_bytes: int, caller: Caller, services: Services) -> str:
    """Queue a comparison that takes at most so many bytes. Raises QuotaError, NearlyFullError, BusyError."""
    identity = new_id()
    with services.access.quotas.planned(caller.name, "comparison", identity, max_bytes):
        return services.comparisons.submit(request, caller.name, identity=identity)


def _check(request: ComparisonRequest, transfer: OpenBake) -> None:
    baked_view(request.view, transfer)
    if transfer.camera_mode is CameraMode.FREE:
        comparison_camera(request, transfer)
        check_picture_size(request.size)
    elif request.camera is not None or request.size is not None:
        name = "camera" if request.size is None else "size"
        raise ParameterError(name, Description("set"), f"no {name}, because this bake has fixed cameras")
    check_look(request.look, transfer, "/look")
    check_display(request.look, "/look")


@router.get("")
def list_comparisons(
    services: ServicesDep,
    page: PageDep,
    state: Annotated[JobState | None, Query()] = None,
    bake: Annotated[Id | None, Query()] = None,
    user: Annotated[UserName | None, Query()] = None,
) -> list[ComparisonBody]:
    """List comparisons, newest first, filtered by state, bake or user; 100 without a `limit`."""
    job_filter = JobFilter(state, user, bake)
    return [_body(job, services) for job in list_jobs(services.comparisons, job_filter, page)]


@router.get("/{comparison}")
def get_comparison(comparison: Id, services: ServicesDep) -> ComparisonBody:
    """State, progress and errors so far."""
    return _body(services.comparisons.get(comparison), services)


@router.delete("/{comparison}", status_code=204)
def stop_comparison(comparison: Id, services: ServicesDep, delete_files: bool = False) -> Response:
    """Stop a comparison; its results are saved, unless `delete_files` is true."""
    (services.comparisons.delete if delete_files else services.comparisons.stop)(comparison)
    if delete_files:
        services.access.quotas.disown("comparison", comparison)
    return Response(status_code=204)


@router.post("/{comparison}/resume", status_code=202)
def resume_comparison(comparison: Id, services: ServicesDep) -> ComparisonBody:
    """Resume a stopped or failed comparison after its last finished pass."""
    services.access.quotas.check_room()
    services.comparisons.resume(comparison)
    return _body(services.comparisons.get(comparison), services)


@router.get(
    "/{comparison}/{name}.png",
    response_class=Download,
    name="get_comparison_picture",
    responses=files("image/png"),
)
def get_picture(
    comparison: Id, name: Picture, services: ServicesDep, passes: Annotated[int | None, Query(ge=0)] = None
) -> Download:
    """Difference image, or the reference so far, for the requested light paths or those of the bake's method. The
    reference is available from the first pass, the difference from the second. `passes` only makes the URL change with
    the image.
    """
    job = services.comparisons.get(comparison)
    path = services.comparisons.picture_path(comparison, name)
    if not path.exists():
        needed = "1 pass" if name.endswith("reference") else "2 passes"
        raise NotReadyError(f"this image needs {needed}, and {job.completed} of {job.total} are done; try again later")
    return Download(path, media_type="image/png", headers={"Cache-Control": "no-store"})


def _body(job: ComparisonJob, services: Services) -> ComparisonBody:
    request = job.request
    figures = dict(services.comparisons.figures(job.id))
    return ComparisonBody.from_object(
        job, bake=request.bake, view=request.view, paths=request.paths, completed=job.completed,
        **format_timestamps(job), **figures,
    )  # fmt: skip
