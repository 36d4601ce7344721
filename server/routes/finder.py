"""/api/scenes/{id}/finder: the scene in plain colours from anywhere, to place cameras by before anything is baked."""

from __future__ import annotations

import io
import math

from fastapi import APIRouter, Response
from fastapi.concurrency import run_in_threadpool
from PIL import Image

from relume.scene.model import Camera
from relume.scene.placed_camera import placed_camera
from server.library.ports import Finder
from server.services import Services, Shared
from server.wire.body import Id
from server.wire.cameras import CameraFrame, FinderBody, FinderPixel, FinderView, PlaceBody
from worker.paths import scene_path
from worker.scenes import get_scene

router = APIRouter(prefix="/api/scenes/{scene}/finder", tags=["scenes"])

JPEG_QUALITY = 85


class JpegResponse(Response):
    """An image; names its media type in the API's description."""

    media_type = "image/jpeg"


@router.get("")
async def get_finder(scene: Id, services: Shared) -> FinderBody:
    """Where the scene is; reads it, which may take seconds."""
    finder = await _finder(scene, services)
    framing = finder.framing
    frame = CameraFrame(to_world=framing.to_world.ravel().tolist(), yfov=math.degrees(framing.yfov))
    return FinderBody(lowest=finder.lowest.tolist(), highest=finder.highest.tolist(), framing=frame)


@router.post("", response_class=JpegResponse, name="draw_finder")
async def picture(scene: Id, view: FinderView, services: Shared) -> JpegResponse:
    """What a camera would see, in plain colours."""
    camera, finder = _camera(view), await _finder(scene, services)

    def drawn() -> bytes:
        file = io.BytesIO()
        Image.fromarray(finder.image(camera, view.size)).save(file, "JPEG", quality=JPEG_QUALITY)
        return file.getvalue()

    return JpegResponse(await run_in_threadpool(drawn), headers={"Cache-Control": "no-store"})


@router.post("/place", name="place_in_finder")
async def place(scene: Id, pixel: FinderPixel, services: Shared) -> PlaceBody:
    """What a position of that picture shows."""
    camera, finder = _camera(pixel), await _finder(scene, services)
    found = await run_in_threadpool(finder.place_at, camera, pixel.size, pixel.x, pixel.y)
    return PlaceBody(position=None if found is None else found.tolist())


async def _finder(scene: str, services: Services) -> Finder:
    record = await run_in_threadpool(get_scene, services.bakes.ledger, scene)
    folder = scene_path(services.settings.data, record.id)
    return await services.pictures.make(("finder", folder), lambda: services.live.library.finder(folder))


def _camera(frame: CameraFrame) -> Camera:
    return placed_camera("finder", frame.to_world, frame.yfov).camera
