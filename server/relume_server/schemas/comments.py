"""Bodies of the calls about comments: words that people pin to a pixel of a picture."""

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
    """Pin words to a pixel.

    `x`, `y`: of the picture of `view` as it was `size` large, from its upper left corner. `camera`: where a view was
    seen from whose eye moves. `text`: plain. `author`: taken where nobody logs in. `picture`: of the moment, a PNG,
    JPEG or WebP in Base64, at most 1024 pixels a side.
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
    """Whether a comment is settled."""

    resolved: bool


class CommentBody(Body):
    """A comment. `picture`: address of the picture of the moment, relative to the server, null where there is none."""

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
