"""/api/color: displays, views and color spaces of the server's OpenColorIO config; views as lookup tables."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Query, Response
from numpy.typing import NDArray

from relume.core.errors import NotFoundError
from relume.image_io.ocio.active_config import get_config
from relume.image_io.ocio.view import MAX_NAME, OcioView
from relume_server.io.png import FOREVER
from relume_server.schemas.base import Id
from relume_server.schemas.color import ColorBody, DisplayBody, ViewBody
from relume_server.services import ServicesDep

router = APIRouter(prefix="/api/color", tags=["color"])
ViewName = Annotated[str, Query(min_length=1, max_length=MAX_NAME)]


class LutResponse(Response):
    """Numbers, little-endian, red slowest."""

    media_type = "application/octet-stream"


@router.get("")
def describe_color() -> ColorBody:
    """Displays, views and color spaces of the config."""
    config = get_config()
    if config is None:
        return ColorBody(id=None, name=None, working=None, displays=[], default=None, spaces=[])
    return ColorBody(
        id=config.id,
        name=config.name,
        working=config.working,
        displays=[DisplayBody(name=name, views=list(views)) for name, views in config.displays.items()],
        default=ViewBody(**asdict(config.default)),
        spaces=list(config.spaces),
    )


@router.get("/{config}/lut", response_class=LutResponse)
async def get_lut(config: Id, display: ViewName, view: ViewName, services: ServicesDep) -> Response:
    """Lookup table of a view: 65 x 65 x 65 x 3 numbers of 16 bits (docs/api.md)."""
    ocio_config = get_config()
    if ocio_config is None or ocio_config.id != config:
        raise NotFoundError("the server's color config has changed; read /api/color again")

    def read_table() -> NDArray[np.uint16]:
        return ocio_config.table(OcioView(display, view)).astype("<u2")

    return await services.responses.stream((config, display, view), read_table, LutResponse.media_type, FOREVER)
