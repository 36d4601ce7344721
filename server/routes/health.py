"""/livez: the process runs. /readyz: it can serve. /metrics: figures for Prometheus."""

from __future__ import annotations

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from sqlalchemy import text

from server.services import Shared

router = APIRouter(tags=["health"])


@router.get("/livez")
async def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive"}


@router.get("/readyz")
def readyz(services: Shared) -> dict[str, str]:
    """The database answers and the data directory is there."""
    with services.bakes.ledger.sessions() as session:
        session.execute(text("SELECT 1"))
    services.settings.data.stat()
    return {"status": "ready"}


@router.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
def metrics(services: Shared) -> Response:
    """Prometheus text."""
    return Response(generate_latest(services.metrics.registry), headers={"Content-Type": CONTENT_TYPE_LATEST})
