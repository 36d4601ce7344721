"""/api/scenes/{id}/comments: comments pinned to pixels. Rooms of the scene are notified of changes."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Response
from fastapi.concurrency import run_in_threadpool

from relume.core.errors import ParameterError
from relume_server.api.bakes import require_ready_bake
from relume_server.api.pagination import PageDep
from relume_server.auth.roles import Caller, CallerDep
from relume_server.collaboration.join import check_person
from relume_server.io.comment_images import small_picture
from relume_server.io.png import A_DAY
from relume_server.openapi import files
from relume_server.persistence.comment_store import Comment, check_text
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import format_timestamp
from relume_server.schemas.comments import CommentBody, CommentChange, CommentRequest
from relume_server.services import Services, ServicesDep
from relume_worker.scenes import get_scene

router = APIRouter(prefix="/api/scenes/{scene}/comments", tags=["comments"])
CommentId = Annotated[Id, Path()]


@router.get("")
def list_comments(scene: Id, services: ServicesDep, page: PageDep, resolved: bool | None = None) -> list[CommentBody]:
    """List comments of a scene, oldest first, filtered by `resolved`."""
    get_scene(services.bakes.ledger, scene)
    comments = [each for each in services.comments.list(scene) if resolved in (None, each.resolved is not None)]
    return [_body(scene, comment) for comment in page.cut(comments, lambda each: (each.created, each.id))]


@router.post("", status_code=201)
async def add_comment(
    scene: Id, request: CommentRequest, services: ServicesDep, caller: CallerDep, response: Response
) -> CommentBody:
    """Add a comment."""
    comment = await run_in_threadpool(_add, services, scene, request, caller)
    services.live.rooms.notify_comment(scene)
    response.headers["Location"] = f"/api/scenes/{scene}/comments/{comment.id}"
    return _body(scene, comment)


def _add(services: Services, scene: str, request: CommentRequest, caller: Caller) -> Comment:
    get_scene(services.bakes.ledger, scene)
    status = require_ready_bake(services, request.bake)
    if status.scene != scene:
        raise ParameterError("/bake", request.bake, "a bake of this scene")
    if request.view not in status.recipe.views:
        raise ParameterError("/view", request.view, "one of " + ", ".join(status.recipe.views)[:400])
    if request.x >= request.size[0] or request.y >= request.size[1]:
        raise ParameterError("/x", [request.x, request.y], "a pixel inside size")
    if request.camera is not None:
        request.camera.custom_camera("camera")
    picture = None if request.picture is None else small_picture(request.picture)
    pin = request.model_dump(include={"bake", "view", "x", "y", "size", "camera"})
    author = caller.person or check_person(request.author or "Guest")
    return services.comments.add(scene, pin, check_text(request.text), author, picture)


@router.patch("/{comment}", status_code=204)
async def resolve_comment(
    scene: Id, comment: CommentId, change: CommentChange, services: ServicesDep, caller: CallerDep
) -> Response:
    """Resolve or reopen a comment."""
    resolver = (caller.person or "somebody") if change.resolved else None
    await run_in_threadpool(services.comments.resolve, scene, comment, resolver)
    services.live.rooms.notify_comment(scene)
    return Response(status_code=204)


@router.delete("/{comment}", status_code=204)
async def delete_comment(scene: Id, comment: CommentId, services: ServicesDep) -> Response:
    """Delete a comment."""
    await run_in_threadpool(services.comments.delete, scene, comment)
    services.live.rooms.notify_comment(scene)
    return Response(status_code=204)


@router.get(
    "/{comment}/picture.webp",
    response_class=Response,
    responses=files("image/webp"),
    name="get_comment_picture",
)
def get_picture(scene: Id, comment: CommentId, services: ServicesDep) -> Response:
    """Snapshot of a comment, at most 320 pixels a side."""
    return Response(services.comments.picture(scene, comment), media_type="image/webp", headers=A_DAY)


def _body(scene: str, comment: Comment) -> CommentBody:
    picture = f"/api/scenes/{scene}/comments/{comment.id}/picture.webp" if comment.has_picture else None
    return CommentBody.from_object(
        comment,
        **comment.pin,
        created=format_timestamp(comment.created),
        resolved=comment.resolved is not None,
        picture=picture,
    )
