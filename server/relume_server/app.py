"""Assemble the server: `create_app(settings)`."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from importlib.metadata import version

import uvicorn
from fastapi import APIRouter, Depends, FastAPI

from relume.core.memory_usage import limit_malloc_arenas
from relume.image_io.ocio.active_config import get_config, using_config
from relume_server import errors, openapi
from relume_server.api import (
    bakes,
    cameras,
    clay,
    client,
    color,
    comments,
    comparisons,
    examples,
    exports,
    health,
    light_mixes,
    login,
    looks,
    models,
    principled,
    probes,
    renders,
    scenes,
    session,
    shares,
    solve,
    viewport,
)
from relume_server.api.assets import (
    balls,
    btf_jobs,
    btfs,
    environments,
    ies,
    images,
    imported,
    library,
    luts,
    materials,
)
from relume_server.api.pagination import check_query
from relume_server.auth.middleware import AuthMiddleware
from relume_server.auth.rules import methods_at
from relume_server.conditional_requests import Conditional
from relume_server.idempotency import Idempotency
from relume_server.io.large_documents import DOCUMENTS_AT_ONCE, LargeDocumentMiddleware
from relume_server.io.upload_middleware import UPLOADS_AT_ONCE, UPLOADS_EACH, UploadMiddleware
from relume_server.lifecycle.connection import Connection
from relume_server.lifecycle.drain import DrainState
from relume_server.lifecycle.server import ServerProcess
from relume_server.lifecycle.websocket_protocol import Socket
from relume_server.request_limits import RequestLimits
from relume_server.root_path import RootPath
from relume_server.runtime.assets import using_asset_stores
from relume_server.runtime.library import open_library
from relume_server.schemas.protocol import MAX_MESSAGE_BYTES
from relume_server.services import OpenBakes, OpenLibrary, OpenSteps, open_bakes, open_services, open_steps
from relume_server.settings import Settings
from relume_server.telemetry.logs.requests import RequestIds
from relume_server.telemetry.logs.setup import set_up
from relume_server.telemetry.metrics import Metrics

ROUTE_GROUPS = (
    scenes,
    cameras,
    comments,
    viewport,
    clay,
    exports,
    examples,
    color,
    models,
    materials,
    imported,
    btf_jobs,  # before btfs, whose route would match "jobs" as an id
    btfs,
    library,
    balls,
    environments,
    ies,
    images,
    luts,
    bakes,
    principled,
    probes,
    light_mixes,
    renders,
    comparisons,
    looks,
    shares,
    solve,
    session,
    login,
    health,
)
# Included once: for each app, FastAPI would build the models of all parameters again, a quarter of a second.
ROUTES = APIRouter(responses=errors.OPENAPI_RESPONSES, generate_unique_id_function=lambda route: route.name)
for _group in ROUTE_GROUPS:
    _takes_any = _group in (session, health)  # a session's address is checked by the session
    ROUTES.include_router(_group.router, dependencies=[] if _takes_any else [Depends(check_query)])

PING_INTERVAL_S = 5.0
"""Interval of pings: of participants whose network is gone, others learn in this time plus the timeout."""
PING_TIMEOUT_S = 20.0
"""Time to answer a ping, which waits behind the frames in flight: for a large one of 2.5 MB, a link of 1 Mbit/s."""


def create_app(
    settings: Settings | None = None,
    *,
    open_library: OpenLibrary = open_library,
    open_bakes: OpenBakes = open_bakes,
    open_steps: OpenSteps = open_steps,
    clock: Callable[[], float] = time.monotonic,
) -> FastAPI:
    """Create the ASGI app; it opens its data at startup and closes it at shutdown.

    Args:
        settings: None: from the environment.
        open_library, open_bakes, open_steps: factories, which tests replace.
        clock: monotonic seconds, for the eviction of unused data.
    """
    settings = settings or Settings()
    metrics, drain = Metrics(), DrainState()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        with using_asset_stores(settings.data), using_config(settings.ocio, settings.ocio_space):
            get_config()  # fail at startup if the config is invalid
            opening = open_services(settings, metrics, drain, open_library, open_bakes, open_steps, clock)
            async with opening as services:
                app.state.services = services
                yield
                del app.state.services

    app = FastAPI(
        title="relume",
        summary="Edit materials and lights in the finished render.",
        version=version("relume"),
        openapi_url="/api/openapi.json",
        docs_url=None,  # the documentation pages load scripts from other sites
        redoc_url=None,
        lifespan=lifespan,
    )
    openapi.install(app)
    app.state.drain = drain
    errors.install(app, methods_at)
    # requests pass the last added middleware first
    app.add_middleware(Idempotency, store=lambda: app.state.services.idempotency)
    app.add_middleware(
        UploadMiddleware,
        access=lambda: app.state.services.access,
        max_per_user=UPLOADS_EACH if settings.login else UPLOADS_AT_ONCE,
        weights=settings.fair_shares,
    )
    app.add_middleware(
        LargeDocumentMiddleware,
        max_per_user=1 if settings.login else DOCUMENTS_AT_ONCE,
        weights=settings.fair_shares,
    )
    app.add_middleware(AuthMiddleware, settings=settings, access=lambda: app.state.services.access, clock=clock)
    app.add_middleware(Conditional)
    app.add_middleware(
        RequestLimits,
        allowed_hosts=[*settings.allowed_hosts, settings.host],
        allowed_origins=settings.allowed_origins,
        max_body_bytes=settings.max_body_bytes,
        max_upload_bytes=settings.max_upload_bytes,
        https_only=settings.https_only,
        count=metrics.count_request,
    )
    app.add_middleware(RootPath, root_path=settings.root_path, identity=lambda: app.state.services.access.identity)
    app.add_middleware(RequestIds)
    app.router.routes.extend(ROUTES.routes)
    app.router.default = client.Client(settings.client)  # not a mount, which would hide 405 responses
    return app


def serve(settings: Settings, on_started: Callable[[], object] = lambda: None) -> None:
    """Run the server until it is stopped; call `on_started` once it accepts connections. Blocks."""
    set_up(settings.log_format, settings.log_level)
    limit_malloc_arenas()
    create_server(create_app(settings), settings, on_started).run()


def create_server(app: FastAPI, settings: Settings, on_started: Callable[[], object] = lambda: None) -> ServerProcess:
    """Create the server, which drains sessions before it stops."""
    return ServerProcess(
        configure(app, settings),
        drain=app.state.drain,
        num_sessions=lambda: app.state.services.access.quotas.num_sessions,
        drain_seconds=settings.drain_seconds,
        stop_seconds=settings.stop_seconds,
        on_started=on_started,
    )


def configure(app: FastAPI, settings: Settings) -> uvicorn.Config:
    """Return the uvicorn configuration of the app."""
    return uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        loop="uvloop",
        http=Connection,
        ws=Socket,
        ws_max_size=MAX_MESSAGE_BYTES,
        ws_ping_interval=PING_INTERVAL_S,
        ws_ping_timeout=PING_TIMEOUT_S,
        ws_per_message_deflate=False,  # frames are dense numbers: compression costs more than it saves
        log_config=None,  # configured by `relume_server.telemetry.logs`
        access_log=False,  # would log resume tokens
        server_header=False,
        proxy_headers=False,  # read by `relume_server.auth.identity`, from trusted proxies only
        timeout_graceful_shutdown=5,
    )
