"""/api/bakes: plan, queue, follow and cancel bakes; material ids of a baked view."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Annotated, cast

from fastapi import APIRouter, Path, Query, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse
from sse_starlette import EventSourceResponse, ServerSentEvent
from starlette.types import Receive, Scope, Send

from relume.assets.environments.thumbnail import thumbnail
from relume.core.errors import NotFoundError
from relume.image_io.write_image import png_bytes
from relume.live.fixed_camera.protocols import CameraMode, FixedViewTransfer
from relume.store.bake_protocol import Plan, Recipe
from relume_server.api.pagination import PageDep, newest
from relume_server.auth.roles import Caller, CallerDep
from relume_server.auth.services import PROXY_REVALIDATION_S
from relume_server.io.png import FOREVER, PngResponse
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import BakeBody, BakeRequest, DryRunBody, PlanBody, RecipeBody, format_timestamp
from relume_server.schemas.cameras import CameraBody
from relume_server.services import Services, ServicesDep
from relume_worker.cameras import resolve_views
from relume_worker.job_state import JobState
from relume_worker.jobs.job import NotReadyError
from relume_worker.presets import PRESETS, resolve_num_probes
from relume_worker.scenes import get_scene
from relume_worker.status import FREE_CAMERA_METHODS, BakeStatus, bake_id

router = APIRouter(prefix="/api/bakes", tags=["bakes"])

EVENT_POLL_S = 0.5


@router.post("", status_code=202, responses={200: {"model": DryRunBody}, 202: {"model": BakeBody}})
def submit_bake(request: BakeRequest, services: ServicesDep, caller: CallerDep) -> JSONResponse:
    """Queue a bake, or with `dry_run` return its cost; the same recipe is the same bake."""
    recipe = _recipe(request, services)
    if request.dry_run:
        return JSONResponse(plan_bake(request.scene, recipe, services).model_dump())
    body = bake_body(queue_bake(request.scene, recipe, caller, services), services)
    return JSONResponse(body.model_dump(), 202, {"Location": f"/api/bakes/{body.id}"})


def plan_bake(scene: str, recipe: Recipe, services: Services) -> DryRunBody:
    """Plan a bake. Raises as `BakeService.plan`."""
    plan = services.bakes.plan(scene, recipe)
    return DryRunBody(id=bake_id(scene, recipe), recipe=_recipe_body(recipe), plan=_plan(plan, services))


def queue_bake(scene: str, recipe: Recipe, caller: Caller, services: Services) -> BakeStatus:
    """Queue a bake for a caller. Raises QuotaError, NearlyFullError, and as `BakeService.submit`."""
    with services.access.quotas.deciding:
        _check_quotas(scene, recipe, caller, services)
        status = services.bakes.get(services.bakes.submit(scene, recipe, caller.name))
        services.access.quotas.assign_owner(caller.name, "bake", status.id, status.plan.planned_bytes)
    services.metrics.bakes.inc()
    return status


def _check_quotas(scene: str, recipe: Recipe, caller: Caller, services: Services) -> None:
    """Check that a caller may queue a bake; existing and running ones are free. Raises QuotaError, NearlyFullError."""
    with suppress(NotFoundError):
        if services.bakes.get(bake_id(scene, recipe)).state in ("queued", "running", "ready"):
            return
    quotas = services.access.quotas
    quotas.check_room()
    quotas.check_bakes(caller.name)
    if quotas.counts_bytes:
        quotas.check_bytes(caller.name, services.bakes.plan(scene, recipe).planned_bytes)


@router.get("")
def list_bakes(
    services: ServicesDep,
    page: PageDep,
    scene: Annotated[Id | None, Query()] = None,
    state: Annotated[JobState | None, Query()] = None,
    user: Annotated[str | None, Query(max_length=80)] = None,
) -> list[BakeBody]:
    """List bakes, newest first, filtered by scene, state or user."""
    statuses = [
        status
        for status in services.bakes.bakes(scene)
        if state in (None, status.state) and user in (None, status.client)
    ]
    statuses = page.cut(statuses, lambda status: newest(status.created, status.id))
    return [bake_body(status, services) for status in statuses]


@router.get("/{bake}")
def get_bake(bake: Id, services: ServicesDep) -> BakeBody:
    """State, progress, rate and remaining time of a bake."""
    return bake_body(services.bakes.get(bake), services)


@router.get(
    "/{bake}/events",
    response_class=EventSourceResponse,
    name="bake_events",
    responses={200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}}},
)
async def bake_events(bake: Id, services: ServicesDep, caller: CallerDep) -> EventSourceResponse:
    """Stream changes as server-sent events `bake` with the body of GET; ends with the bake, or with the token."""
    await run_in_threadpool(services.bakes.get, bake)
    return _Events(bake, services, caller)


class _Events(EventSourceResponse):
    """Event stream that counts against the caller's quota until it ends."""

    def __init__(self, bake: str, services: Services, caller: Caller) -> None:
        super().__init__(_events(bake, services, caller), headers={"Cache-Control": "no-store"})
        self._counted = services.access.quotas.stream(caller)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the stream, as `EventSourceResponse` does. Raises QuotaError before anything is sent."""
        with self._counted:
            await super().__call__(scope, receive, send)


async def _events(bake: str, services: Services, caller: Caller) -> AsyncIterator[ServerSentEvent]:
    """Yield changes while the caller is authorized; a caller named by a proxy is checked again after a while."""
    last_status: BakeStatus | None = None
    until_s = time.monotonic() + (PROXY_REVALIDATION_S if caller.auth_method == "proxy" else math.inf)
    while (
        (last_status is None or not last_status.final)
        and time.monotonic() < until_s
        and await services.access.may_stay(caller)
    ):
        try:
            status = await run_in_threadpool(services.bakes.get, bake)
        except NotFoundError:  # deleted with its scene
            return
        if status != last_status:
            last_status = status
            body = await run_in_threadpool(bake_body, status, services)
            yield ServerSentEvent(body.model_dump_json(), event="bake")
        else:
            await asyncio.sleep(EVENT_POLL_S)


@router.delete("/{bake}", status_code=204)
def cancel_bake(bake: Id, services: ServicesDep, delete_files: bool = False) -> Response:
    """Cancel a bake; finished tasks stay for a resume. With `delete_files` the bake is deleted, finished or not."""
    if delete_files:
        services.bakes.delete(bake)
        services.access.quotas.disown("bake", bake)
    elif not services.bakes.cancel(bake) and (state := services.bakes.get(bake).state) != "canceled":
        raise NotReadyError(f"the bake is {state}, so there is nothing to cancel; ?delete_files=true deletes it")
    return Response(status_code=204)


@router.get("/{bake}/views/{view}/materials.png", response_class=PngResponse, name="get_material_ids")
async def material_ids(bake: Id, view: Annotated[str, Path(max_length=256)], services: ServicesDep) -> Response:
    """16-bit gray PNG with the material of each pixel, as index into the scene's materials; 65535 is background."""
    await run_in_threadpool(require_ready_bake, services, bake)
    async with services.transfers.acquire(bake, services.bakes.store_path(bake)) as transfer:
        if view not in transfer.views:
            raise NotFoundError(f"this bake has no view {view[:80]!r}; its views are {', '.join(transfer.views)[:400]}")
        if transfer.camera_mode is CameraMode.FREE:
            raise NotFoundError(f"view {view[:80]!r} has a free camera; read its pixels in a session")
        fixed_view = cast("FixedViewTransfer", transfer).views[view]
        key, media_type = (bake, view, "materials"), PngResponse.media_type
        return await services.responses.stream(key, lambda: png_bytes(fixed_view.material_ids()), media_type, FOREVER)


@router.get("/{bake}/environment.png", response_class=PngResponse, name="get_own_environment")
async def scene_environment(bake: Id, services: ServicesDep) -> PngResponse:
    """The environment that was baked, as a thumbnail like those of /api/environments."""
    await run_in_threadpool(require_ready_bake, services, bake)
    async with services.transfers.acquire(bake, services.bakes.store_path(bake)) as transfer:
        png = await services.pictures.run(("environment", bake), lambda: thumbnail(transfer.environment_radiance(None)))
    return PngResponse(png, headers=FOREVER)


def require_ready_bake(services: Services, bake: str) -> BakeStatus:
    """Return a bake that can be opened. Raises NotFoundError, NotReadyError."""
    status = services.bakes.get(bake)
    if status.state != "ready":
        raise NotReadyError(f"the bake is {status.state}; wait until it is ready")
    return status


def _recipe(request: BakeRequest, services: Services) -> Recipe:
    """Make the recipe: the preset, overridden by the request; by default all views of the file."""
    ledger = services.bakes.ledger
    requested_views = [view if isinstance(view, str) else view.custom_camera(view.name) for view in request.views or ()]
    views, cameras = resolve_views(ledger, get_scene(ledger, request.scene), requested_views)
    preset = PRESETS[request.preset or "good"]
    num_lights = request.lights or preset.num_lights
    num_probes = resolve_num_probes(request.method, request.probes)
    size = request.size or (preset.size if request.aspect is None else preset.fit_aspect(request.aspect))
    gathering = (request.patches, request.gather_rays)
    return Recipe(request.method, views, size, num_lights, request.relightable, cameras, num_probes, *gathering)


def bake_body(status: BakeStatus, services: Services) -> BakeBody:
    """Make the body of a bake."""
    seconds = None if status.phase_since is None else max(0.0, round(time.time() - status.phase_since, 1))
    plan = _plan(status.plan, services)
    more = {"plan": plan, "phase_seconds": seconds, "created": format_timestamp(status.created), "user": status.client}
    return BakeBody.from_object(status, recipe=_recipe_body(status.recipe), **more)


def _recipe_body(recipe: Recipe) -> RecipeBody:
    return RecipeBody(
        method=recipe.method,
        views=list(recipe.views),
        size=recipe.size,
        lights=recipe.num_lights,
        probes=recipe.num_probes if recipe.method in FREE_CAMERA_METHODS else None,
        patches=recipe.num_patches,
        gather_rays=recipe.gather_rays,
        relightable=recipe.relightable,
        cameras=[CameraBody(**camera.document()) for camera in recipe.cameras],
    )


def _plan(plan: Plan, services: Services) -> PlanBody:
    return PlanBody(
        view_samples=plan.num_view_samples,
        rays=plan.num_rays,
        store_bytes=plan.planned_bytes,
        peak_bytes=plan.peak_bytes,
        seconds=services.bakes.estimate_seconds(plan),
    )
