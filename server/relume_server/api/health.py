"""/livez: the process runs. /readyz: it can serve. /metrics: Prometheus metrics."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from relume_server.services import ServicesDep

router = APIRouter(tags=["health"])


@router.get("/livez")
async def livez() -> dict[str, str]:
    """The process responds."""
    return {"status": "alive"}


@router.get("/readyz")
async def readyz(services: ServicesDep) -> dict[str, str]:
    """The database is readable, the data directory has space, and the server is not draining."""
    services.drain.check()
    await services.readiness.check()
    return {"status": "ready"}


@router.get("/metrics", response_class=PlainTextResponse)
def metrics(services: ServicesDep) -> PlainTextResponse:
    """Metrics in the Prometheus text format."""
    return PlainTextResponse(generate_latest(services.metrics.registry), headers={"Content-Type": CONTENT_TYPE_LATEST})
