"""/api/looks: saved looks. A change names the version it changes (If-Match); a new one may say If-None-Match: *."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Header, Request, Response
from fastapi.concurrency import run_in_threadpool

from relume.errors import ParameterError
from server.openapi import LOOK
from server.records.looks import SavedLook, check_name, parse_document
from server.routes.paging import Paged, newest
from server.services import Shared
from server.wire.bodies import LookEntry, moment

router = APIRouter(prefix="/api/looks", tags=["looks"])
Etags = Annotated[str | None, Header(max_length=4096)]
LOOK_CONTENT = {"application/json": {"schema": {"$ref": LOOK}}}
LOOK_BODY = {"requestBody": {"required": True, "content": LOOK_CONTENT}}


@router.get("")
def list_looks(services: Shared, page: Paged) -> list[LookEntry]:
    """Names and versions, newest first."""
    looks = page.cut(services.looks.list(), lambda look: newest(look.modified, look.name))
    return [LookEntry.of(look, modified=moment(look.modified), bytes=look.num_bytes) for look in looks]


@router.get("/{name}", responses={200: {"content": LOOK_CONTENT}})
def get_look(name: str, services: Shared) -> Response:
    """One look, with its version as ETag."""
    look = services.looks.get(check_name(name))
    return Response(look.document, headers=_headers(look), media_type="application/json")


@router.put(
    "/{name}",
    responses={201: {"description": "Created"}, 204: {"description": "Replaced"}},
    status_code=204,
    openapi_extra=LOOK_BODY,
)
async def put_look(
    name: str, request: Request, services: Shared, if_match: Etags = None, if_none_match: Etags = None
) -> Response:
    """Save a look: 201 where it is new, 204 where it replaces the version that If-Match names."""
    if if_none_match not in (None, "*"):
        raise ParameterError("If-None-Match", if_none_match, "* or nothing")
    name, document = check_name(name), parse_document(await request.body())
    look, is_new = await run_in_threadpool(services.looks.put, name, document, if_match, if_none_match)
    return Response(status_code=201 if is_new else 204, headers=_headers(look))


@router.delete("/{name}", status_code=204)
def delete_look(name: str, services: Shared, if_match: Etags = None) -> Response:
    """Delete the version that If-Match names."""
    services.looks.delete(check_name(name), if_match)
    return Response(status_code=204)


def _headers(look: SavedLook) -> dict[str, str]:
    return {"ETag": look.etag, "Cache-Control": "no-cache"}
