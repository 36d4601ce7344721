"""Bodies of comments: text pinned to a pixel of a view."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from relume_server.schemas.base import Body, Id, Name
from relume_server.schemas.cameras import CameraFrame
from relume_server.schemas.rooms import PersonName

MAX_COMMENT = 2000
MAX_PICTURE_TEXT = 350_000
Side = Annotated[int, Field(ge=1, le=16384)]
PixelCoordinate = Annotated[int, Field(ge=0, lt=16384)]


class CommentRequest(Body):
    """Pin a comment to a pixel.

    `x`, `y`: pixel of the image of `view` at `size`, from its upper left corner. `camera`: free camera of the view, if
    any. `text`: plain. `author`: used if the server has no login. `picture`: snapshot, a PNG, JPEG or WebP in Base64,
    at most 1024 pixels a side.
    """

    bake: Id
    view: Name
    x: PixelCoordinate
    y: PixelCoordinate
    size: tuple[Side, Side]
    camera: CameraFrame | None = None
    text: Annotated[str, Field(min_length=1, max_length=MAX_COMMENT)]
    author: PersonName | None = None
    picture: Annotated[str, Field(max_length=MAX_PICTURE_TEXT)] | None = None


class CommentChange(Body):
    """Resolve or reopen a comment."""

    resolved: bool


class CommentBody(Body):
    """A comment. `picture`: URL of the snapshot, relative to the server, null if there is none."""

    id: str
    bake: str
    view: str
    x: int
    y: int
    size: tuple[int, int]
    camera: CameraFrame | None
    text: str
    author: str
    created: str
    resolved: bool
    resolved_by: str | None
    picture: str | None
