"""/api/looks: saved looks. A change names its version (If-Match); a new look may send If-None-Match: *."""

from __future__ import annotations

from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Header, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse
from pydantic import AwareDatetime

from relume.core.errors import ParameterError
from relume_server.api.pagination import PageDep, newest
from relume_server.io.comment_images import small_picture
from relume_server.openapi import LOOK, files
from relume_server.persistence.look_store import ListedLook, SavedLook, check_name, parse_document
from relume_server.schemas.bodies import LookEntry, ThumbnailRequest, format_timestamp
from relume_server.schemas.cameras import LookView
from relume_server.services import ServicesDep

router = APIRouter(prefix="/api/looks", tags=["looks"])
Etags = Annotated[str | None, Header(max_length=4096)]
LOOK_CONTENT = {"application/json": {"schema": {"$ref": LOOK}}}
LOOK_BODY = {"requestBody": {"required": True, "content": LOOK_CONTENT}}


@router.get("")
def list_looks(services: ServicesDep, page: PageDep) -> list[LookEntry]:
    """List names and versions, newest first."""
    return [_entry(look) for look in page.cut(services.looks.list(), lambda look: newest(look.modified, look.name))]


@router.get("/{name}", responses={200: {"content": LOOK_CONTENT}})
def get_look(name: str, services: ServicesDep) -> Response:
    """Return a look, with its version as ETag."""
    look = services.looks.get(check_name(name))
    return Response(look.document, headers=_headers(look), media_type="application/json")


@router.put(
    "/{name}",
    responses={201: {"model": LookEntry, "description": "Created"}, 204: {"description": "Replaced"}},
    status_code=204,
    openapi_extra=LOOK_BODY,
)
async def put_look(
    name: str,
    request: Request,
    services: ServicesDep,
    if_match: Etags = None,
    if_none_match: Etags = None,
    created: AwareDatetime | None = None,
) -> Response:
    """Save a look: 201 if it is new, 204 if it replaces the version in If-Match.

    `created` keeps the position in lists of a look that is renamed or restored.
    """
    if if_none_match not in (None, "*"):
        raise ParameterError("If-None-Match", if_none_match, "*, or leave it out")
    name, document = check_name(name), parse_document(await request.body())
    since = None if created is None else created.timestamp()
    look, is_new = await run_in_threadpool(services.looks.put, name, document, if_match, if_none_match, since)
    if is_new:
        return JSONResponse(_entry(look).model_dump(), 201, headers=_headers(look))
    return Response(status_code=204, headers=_headers(look))


@router.put("/{name}/thumbnail", status_code=204, name="put_look_thumbnail")
def put_thumbnail(name: str, request: ThumbnailRequest, services: ServicesDep, if_match: Etags = None) -> Response:
    """Store a thumbnail of the version in If-Match; later versions have none."""
    services.looks.put_thumbnail(check_name(name), small_picture(request.picture), if_match)
    return Response(status_code=204)


@router.put("/{name}/view", status_code=204, name="put_look_view")
def put_view(name: str, request: LookView, services: ServicesDep, if_match: Etags = None) -> Response:
    """Store a view with the look in If-Match, so that choosing the look restores both; later versions keep it."""
    if request.camera is not None:
        request.camera.custom_camera(request.view)
    services.looks.put_view(check_name(name), request.model_dump_json(), if_match)
    return Response(status_code=204)


@router.delete("/{name}/view", status_code=204, name="delete_look_view")
def delete_view(name: str, services: ServicesDep, if_match: Etags = None) -> Response:
    """Remove the view of the look in If-Match."""
    services.looks.put_view(check_name(name), None, if_match)
    return Response(status_code=204)


@router.get(
    "/{name}/thumbnail.webp",
    response_class=Response,
    name="get_look_thumbnail",
    responses=files("image/webp"),
)
def get_thumbnail(
    name: str, services: ServicesDep, version: Annotated[str | None, Query(max_length=64)] = None
) -> Response:
    """Thumbnail of the current version, at most 320 pixels a side; `version` only makes the URL change with it."""
    picture = services.looks.thumbnail(check_name(name))
    return Response(picture, media_type="image/webp", headers={"Cache-Control": "no-cache"})


@router.delete("/{name}", status_code=204)
def delete_look(name: str, services: ServicesDep, if_match: Etags = None) -> Response:
    """Delete the version in If-Match."""
    services.looks.delete(check_name(name), if_match)
    return Response(status_code=204)


def _entry(look: SavedLook | ListedLook) -> LookEntry:
    address = f"/api/looks/{quote(look.name, safe='')}/thumbnail.webp?version={look.etag.strip(chr(34))}"
    return LookEntry(
        name=look.name,
        etag=look.etag,
        created=format_timestamp(look.created),
        modified=format_timestamp(look.modified),
        bytes=look.num_bytes,
        thumbnail=address if look.has_thumbnail else None,
        view=None if look.view is None else LookView.model_validate_json(look.view),
    )


def _headers(look: SavedLook) -> dict[str, str]:
    return {"ETag": look.etag, "Cache-Control": "no-cache"}
