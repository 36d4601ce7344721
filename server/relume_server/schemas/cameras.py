"""Bodies of placed cameras."""

from __future__ import annotations

import math
from typing import Annotated, Self

from pydantic import Field

from relume.scene.custom_camera import CustomCamera, make_custom_camera
from relume.scene.lens import Lens, make_lens
from relume.scene.model import Camera
from relume_server.schemas.base import Body, Name

MAX_PATH_POINTS = 64
PathCoordinate = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False)]
PathPoint = tuple[PathCoordinate, PathCoordinate, PathCoordinate]
MIN_SIDE, MAX_SIDE = 16, 1024  # pixels
ViewportSide = Annotated[int, Field(ge=MIN_SIDE, le=MAX_SIDE)]


class CameraFrame(Body):
    """Pose and field of view of a camera.

    `to_world`: camera to world, 16 numbers, row by row, looking along -Z; scale is removed. `yfov`: vertical, degrees.
    `near`: distance of the near clipping plane, meters; light and shadows are those of the whole scene.
    """

    to_world: Annotated[list[float], Field(min_length=16, max_length=16)]
    yfov: float
    near: float = 0.0

    @classmethod
    def from_camera(cls, camera: Camera) -> Self:
        """Describe a camera."""
        return cls(to_world=camera.to_world.ravel().tolist(), yfov=math.degrees(camera.yfov), near=camera.near)

    def custom_camera(self, name: str) -> CustomCamera:
        """Validate it. Raises ParameterError."""
        return make_custom_camera(name, self.to_world, self.yfov, self.near)


class LensBody(Body):
    """Depth of field: `radius` of the aperture and depth that is sharp, meters; `blades` of a polygon, 0: round."""

    radius: float
    focus_distance: float
    blades: int = 0

    def lens(self) -> Lens:
        """Validate it. Raises ParameterError."""
        return make_lens(self.radius, self.focus_distance, self.blades)


class FixedCameraFrame(CameraFrame):
    """Camera of a bake; without a `lens` everything is sharp. A free camera has none."""

    lens: LensBody | None = None

    @classmethod
    def from_camera(cls, camera: Camera) -> Self:
        """Describe a camera."""
        lens = camera.lens and LensBody(**camera.lens.document())
        return super().from_camera(camera).model_copy(update={"lens": lens})

    def custom_camera(self, name: str) -> CustomCamera:
        """Validate it. Raises ParameterError."""
        lens = None if self.lens is None else self.lens.lens()
        return make_custom_camera(name, self.to_world, self.yfov, self.near, lens)


class CameraBody(FixedCameraFrame):
    """A camera that a user placed, by name."""

    name: Name


class CameraEntry(CameraBody):
    """A camera of a scene; `is_placed`: placed by a user, not from the scene's file."""

    is_placed: bool


class LookView(Body):
    """The view of a saved look: a view by name, and the pose of its free camera; null: as baked."""

    view: Name
    camera: CameraFrame | None = None


class ViewportBody(Body):
    """Bounds of a scene, meters; a camera that sees all of it; one in its largest room, null if nothing is enclosed.

    `opens_inside`: the scene is a closed room that its first camera sees only from outside.
    """

    bounds_min: list[float]
    bounds_max: list[float]
    default_camera: CameraFrame
    interior_camera: CameraFrame | None
    opens_inside: bool


class PathRequest(Body):
    """Corners of a path, meters."""

    points: Annotated[list[PathPoint], Field(min_length=2, max_length=MAX_PATH_POINTS)]


class PathBody(Body):
    """The first surface on a path: path `length` to it, meters, its material and unit normal; null without one."""

    length: float | None
    material: str | None
    normal: tuple[float, float, float] | None


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
