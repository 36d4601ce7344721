"""/api/scenes/{id}/clay.png: the shape of a scene in gray, until a bake has its first picture."""

from __future__ import annotations

import io
from typing import Annotated

from fastapi import APIRouter, Query
from fastapi.concurrency import run_in_threadpool
from PIL import Image

from relume.scene.model import Camera
from relume_server.api.scenes import DEFAULT_ASPECT
from relume_server.api.viewport import open_viewport
from relume_server.io.png import A_DAY, PngResponse
from relume_server.openapi import files
from relume_server.schemas.base import Id, Name
from relume_server.schemas.cameras import MAX_SIDE, MIN_SIDE, ViewportSide
from relume_server.services import ServicesDep
from relume_worker.cameras import get_camera
from relume_worker.paths import scene_path
from relume_worker.scenes import get_scene
from relume_worker.storage import fetch_if_missing

router = APIRouter(prefix="/api/scenes/{scene}/clay.png", tags=["scenes"])

DEFAULT_WIDTH = 640
NO_CACHE = {"Cache-Control": "private, no-cache"}  # a placed camera may move
PNG_LEVEL = 1  # faster than sending the bytes that a higher level saves


@router.get("", response_class=PngResponse, responses=files("image/png"))
async def get_clay(
    scene: Id,
    services: ServicesDep,
    camera: Annotated[Name | None, Query(description="of the scene; its first without one")] = None,
    width: ViewportSide = DEFAULT_WIDTH,
    height: Annotated[ViewportSide | None, Query(description="from the camera without one")] = None,
) -> PngResponse:
    """Return a picture of all surfaces in gray, without a bake; reads the scene, which may take seconds."""

    def read_camera() -> Camera:
        record = get_scene(services.bakes.ledger, scene)
        folder = fetch_if_missing(scene_path(services.settings.data, record.id))
        return get_camera(folder, services.bakes.ledger, record.id, camera)

    pose, viewport = await run_in_threadpool(read_camera), await open_viewport(scene, services)
    size = width, height or min(max(round(width / (pose.aspect or DEFAULT_ASPECT)), MIN_SIDE), MAX_SIDE)

    def encode_png() -> bytes:
        file = io.BytesIO()
        Image.fromarray(viewport.clay(pose, size)).save(file, "PNG", compress_level=PNG_LEVEL)
        return file.getvalue()

    key = "clay", scene, pose.to_world.tobytes(), pose.yfov, pose.near, size
    image = await services.pictures.run(key, encode_png)
    return PngResponse(image, headers=A_DAY if camera is None else NO_CACHE)
