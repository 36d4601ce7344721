"""/api/shares: share links. Their content is validated once, and never changes."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response
from fastapi.concurrency import run_in_threadpool

from relume import look as looks
from relume.assets.environments.environment_names import environment_exists
from relume.assets.measured.measured_store import STORE as MEASURED
from relume.core.errors import NotFoundError
from relume.live.fixed_camera.protocols import OpenBake
from relume_server.api.bakes import require_ready_bake
from relume_server.api.pagination import PageDep, newest
from relume_server.api.renders import baked_view, check_look, check_picture_size
from relume_server.persistence.share_store import MAX_ID_LENGTH
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import ShareBody, ShareEntry, ShareListEntry, ShareRequest, format_timestamp
from relume_server.services import Services, ServicesDep
from relume_worker.scenes import get_scene

router = APIRouter(prefix="/api/shares", tags=["shares"])
ShareId = Annotated[str, Path(max_length=MAX_ID_LENGTH, pattern=r"^[a-z2-7]+$")]


@router.post("", status_code=201, responses={200: {"model": ShareEntry, "description": "Shared before"}})
async def create_share(request: ShareRequest, services: ServicesDep, response: Response) -> ShareEntry:
    """Save the content of a share link: 201, or 200 if the same content was shared before."""
    status = await run_in_threadpool(require_ready_bake, services, request.bake)
    async with services.transfers.acquire(request.bake, services.bakes.store_path(request.bake)) as transfer:
        look = await run_in_threadpool(_complete, request, transfer)
    document = {**request.model_dump(), "scene": status.scene, "look": look}
    identity, is_new = await run_in_threadpool(services.shares.put, document)
    response.status_code = 201 if is_new else 200
    response.headers["Location"] = f"/api/shares/{identity}"
    return ShareEntry(id=identity, url=f"/?share={identity}")


def _complete(request: ShareRequest, transfer: OpenBake) -> dict[str, Any]:
    """Complete the look, so that later changes of defaults do not affect it."""
    for name in {request.view, *request.views, *request.cameras, *request.sizes}:
        baked_view(name, transfer)
    for name, frame in request.cameras.items():
        frame.custom_camera(name)
    for size in request.sizes.values():
        check_picture_size(size)
    check_look(request.look, transfer, "/look")
    return looks.complete(request.look, transfer.default_look)


@router.get("")
def list_shares(
    services: ServicesDep, page: PageDep, bake: Annotated[Id | None, Query()] = None
) -> list[ShareListEntry]:
    """List share links, newest first, filtered by bake."""
    links = services.shares.list("" if bake is None else f'"bake":"{bake}"')
    links = page.cut(links, lambda link: newest(link.created, link.id))
    return [
        ShareListEntry.from_object(link, url=f"/?share={link.id}", created=format_timestamp(link.created))
        for link in links
    ]


@router.get("/{share}")
def get_share(share: ShareId, services: ServicesDep, response: Response) -> ShareBody:
    """Content of a share link, and its deleted parts."""
    record = services.shares.get(share)
    response.headers["Cache-Control"] = "no-cache"
    return ShareBody(
        id=record.id,
        created=format_timestamp(record.created),
        missing=_missing_assets(record.document, services),
        **record.document,
    )


@router.delete("/{share}", status_code=204)
def delete_share(share: ShareId, services: ServicesDep) -> Response:
    """Delete a share link."""
    services.shares.delete(share)
    return Response(status_code=204)


def _missing_assets(document: dict[str, Any], services: Services) -> list[str]:
    """Deleted assets of a share link, one sentence each."""
    try:
        get_scene(services.bakes.ledger, document["scene"])
    except NotFoundError:
        return ["The scene of this link was deleted; ask its sender to import it again."]
    terms = [term for material in document["look"]["materials"].values() for term in material["terms"]]
    measured = sorted({term["data"] for term in terms if "data" in term})
    map_name = document["look"]["environment"]["map"]
    missing = [
        f"The measured material {name} of this link was deleted; import it again."
        for name in measured
        if not MEASURED.exists(name)
    ]
    if map_name is not None and not environment_exists(map_name):
        missing.append(f"The environment {map_name} of this link was deleted; import it again.")
    return missing
