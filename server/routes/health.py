"""/livez: the process runs. /readyz: it can serve. /metrics: figures for Prometheus."""

from __future__ import annotations

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from sqlalchemy import select

from server.errors import NearlyFullError
from server.library.disk import free_bytes
from server.services import Shared
from worker.database.models import BakeRow

router = APIRouter(tags=["health"])


@router.get("/livez")
async def livez() -> dict[str, str]:
    """The process answers."""
    return {"status": "alive"}


@router.get("/readyz")
def readyz(services: Shared) -> dict[str, str]:
    """The database can be read, the data directory has room, and the server is not being stopped."""
    services.leave.check()
    with services.bakes.ledger.sessions() as session:
        session.execute(select(BakeRow.id).limit(1))
    free = free_bytes(services.settings.data)
    if free < services.settings.least_free_bytes:
        raise NearlyFullError(f"the disk of the data directory has {free / 1e6:,.0f} MB left; free some space")
    return {"status": "ready"}


@router.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
def metrics(services: Shared) -> Response:
    """Prometheus text."""
    return Response(generate_latest(services.metrics.registry), headers={"Content-Type": CONTENT_TYPE_LATEST})
