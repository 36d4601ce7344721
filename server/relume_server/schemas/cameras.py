"""Bodies of placed cameras."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from relume_server.schemas.base import Body, Name

ViewportSide = Annotated[int, Field(ge=16, le=1024)]


class CameraFrame(Body):
    """Pose and field of view of a camera.

    `to_world`: camera to world, 16 numbers, row by row, looking along -Z; scale is removed. `yfov`: vertical, degrees.
    """

    to_world: Annotated[list[float], Field(min_length=16, max_length=16)]
    yfov: float


class CameraBody(CameraFrame):
    """A camera that a user placed, by name."""

    name: Name


class CameraEntry(CameraBody):
    """A camera of a scene; `is_placed`: placed by a user, not from the scene's file."""

    is_placed: bool


class ViewportBody(Body):
    """Bounds of a scene, meters, and a camera that sees all of it."""

    bounds_min: list[float]
    bounds_max: list[float]
    default_camera: CameraFrame


class ViewportRequest(CameraFrame):
    """A camera, and the size of its image in pixels."""

    size: tuple[ViewportSide, ViewportSide]


class ViewportPixel(ViewportRequest):
    """A pixel of such an image, from the left and from the top."""

    x: Annotated[float, Field(ge=0, le=1024)]
    y: Annotated[float, Field(ge=0, le=1024)]


class PickBody(Body):
    """Point and normal in world space, meters; null if nothing is there."""

    position: list[float] | None
