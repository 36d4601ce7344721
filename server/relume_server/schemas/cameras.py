"""Bodies of the calls that place cameras."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from relume_server.schemas.base import Body, Name

ViewportSide = Annotated[int, Field(ge=16, le=1024)]


class CameraFrame(Body):
    """Where a camera is and how wide it looks.

    `to_world`: camera to world, 16 numbers by row, looking along -Z; scale is taken out. `yfov`: vertical, degrees.
    """

    to_world: Annotated[list[float], Field(min_length=16, max_length=16)]
    yfov: float


class CameraBody(CameraFrame):
    """A camera that a person placed, by name."""

    name: Name


class CameraEntry(CameraBody):
    """A camera of a scene; `is_placed`: somebody placed it, it did not come with the scene."""

    is_placed: bool


class ViewportBody(Body):
    """The bounds of a scene, metres, and a camera that sees all of it."""

    bounds_min: list[float]
    bounds_max: list[float]
    default_camera: CameraFrame


class ViewportRequest(CameraFrame):
    """A camera, and how many pixels of its picture are wanted."""

    size: tuple[ViewportSide, ViewportSide]


class ViewportPixel(ViewportRequest):
    """A position in such a picture, pixels from the left and from the top."""

    x: Annotated[float, Field(ge=0, le=1024)]
    y: Annotated[float, Field(ge=0, le=1024)]


class PickBody(Body):
    """World space, metres; null where nothing is there."""

    position: list[float] | None
