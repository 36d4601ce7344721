"""/api/scenes/{id}/viewport: preview of a scene in plain colors, to place cameras before baking."""

from __future__ import annotations

import io

from fastapi import APIRouter, Response
from fastapi.concurrency import run_in_threadpool
from PIL import Image

from relume_server.runtime.protocols import PlacementViewport
from relume_server.schemas.base import Id
from relume_server.schemas.cameras import (
    CameraFrame,
    PathBody,
    PathRequest,
    PickBody,
    ViewportBody,
    ViewportPixel,
    ViewportRequest,
)
from relume_server.services import Services, ServicesDep
from relume_worker.paths import scene_path
from relume_worker.scenes import get_scene

router = APIRouter(prefix="/api/scenes/{scene}/viewport", tags=["scenes"])

JPEG_QUALITY = 85


class JpegResponse(Response):
    """JPEG image; names its media type in the OpenAPI description."""

    media_type = "image/jpeg"


@router.get("")
async def get_viewport(scene: Id, services: ServicesDep) -> ViewportBody:
    """Bounds of a scene; reads the scene, which may take seconds."""
    viewport = await open_viewport(scene, services)
    return await services.pictures.run(("bounds", scene), lambda: _body(viewport))


def _body(viewport: PlacementViewport) -> ViewportBody:
    """Describe it; finds a room first, which takes as long as reading the scene."""
    interior = viewport.interior_camera
    return ViewportBody(
        bounds_min=viewport.bounds_min.tolist(),
        bounds_max=viewport.bounds_max.tolist(),
        default_camera=CameraFrame.from_camera(viewport.default_camera),
        interior_camera=None if interior is None else CameraFrame.from_camera(interior),
        opens_inside=viewport.opens_inside,
    )


@router.post("", response_class=JpegResponse, name="draw_viewport")
async def draw_viewport(scene: Id, view: ViewportRequest, services: ServicesDep) -> JpegResponse:
    """Image of a camera in plain colors."""
    camera, viewport = view.custom_camera("finder").camera, await open_viewport(scene, services)

    def encode_jpeg() -> bytes:
        file = io.BytesIO()
        Image.fromarray(viewport.image(camera, view.size)).save(file, "JPEG", quality=JPEG_QUALITY)
        return file.getvalue()

    return JpegResponse(await run_in_threadpool(encode_jpeg), headers={"Cache-Control": "no-store"})


@router.post("/pick", name="pick_in_viewport")
async def pick(scene: Id, pixel: ViewportPixel, services: ServicesDep) -> PickBody:
    """Surface point at a pixel of such an image."""
    camera, viewport = pixel.custom_camera("finder").camera, await open_viewport(scene, services)
    position = await run_in_threadpool(viewport.point_at, camera, pixel.size, pixel.x, pixel.y)
    return PickBody(position=None if position is None else position.tolist())


@router.post("/path", name="first_obstacle_in_viewport")
async def first_obstacle(scene: Id, path: PathRequest, services: ServicesDep) -> PathBody:
    """First surface on a path, which stops a camera."""
    viewport = await open_viewport(scene, services)
    length, material, normal = await run_in_threadpool(viewport.first_obstacle, path.points)
    return PathBody(length=length, material=material, normal=normal)


async def open_viewport(scene: str, services: Services) -> PlacementViewport:
    """Read a scene, unless it was used recently. Raises NotFoundError."""
    record = await run_in_threadpool(get_scene, services.bakes.ledger, scene)
    folder = scene_path(services.settings.data, record.id)
    return await services.pictures.run(("finder", folder), lambda: services.live.library.open_viewport(folder))
