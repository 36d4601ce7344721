"""/api/scenes/{id}/cameras: cameras that people place in a scene; bakes take them by name."""

from __future__ import annotations

import math
from typing import Annotated

from fastapi import APIRouter, Path, Response

from relume.errors import NotFoundError
from relume.scene.archive import load_cameras
from relume.scene.placed_camera import placed_camera
from server.routes.paging import Paged
from server.services import Services, Shared
from server.wire.body import MAX_NAME, Id
from server.wire.cameras import CameraEntry, CameraFrame
from worker.cameras import delete_camera, keep_camera, kept_cameras
from worker.paths import scene_path
from worker.scenes import get_scene
from worker.storage import fetched

router = APIRouter(prefix="/api/scenes/{scene}/cameras", tags=["scenes"])
CameraName = Annotated[str, Path(min_length=1, max_length=MAX_NAME)]


@router.get("", name="list_cameras")
def get_cameras(scene: Id, services: Shared, page: Paged) -> list[CameraEntry]:
    """The cameras that came with the scene, then those that were placed, by name."""
    return page.in_order(_entries(scene, services))


@router.get("/{name}")
def get_camera(scene: Id, name: CameraName, services: Shared) -> CameraEntry:
    """One camera."""
    for entry in _entries(scene, services):
        if entry.name == name:
            return entry
    raise NotFoundError(f"the scene has no camera {name[:80]!r}")


@router.put("/{name}", status_code=204, responses={201: {"description": "Created"}, 204: {"description": "Replaced"}})
def put_camera(scene: Id, name: CameraName, frame: CameraFrame, services: Shared) -> Response:
    """Keep a camera under a name: 201 where it is new. Bakes of an earlier one stay what they are."""
    is_new = keep_camera(services.bakes.ledger, scene, placed_camera(name, frame.to_world, frame.yfov))
    return Response(status_code=201 if is_new else 204)


@router.delete("/{name}", status_code=204, name="delete_camera")
def delete_one(scene: Id, name: CameraName, services: Shared) -> Response:
    """Forget a camera that was placed; bakes of it stay."""
    delete_camera(services.bakes.ledger, scene, name)
    return Response(status_code=204)


def _entries(scene: str, services: Services) -> list[CameraEntry]:
    record = get_scene(services.bakes.ledger, scene)
    own = [
        CameraEntry(name=c.name, to_world=c.to_world.ravel().tolist(), yfov=math.degrees(c.yfov), is_placed=False)
        for c in load_cameras(fetched(scene_path(services.settings.data, record.id)))
    ]
    placed = kept_cameras(services.bakes.ledger, record.id)
    return own + [CameraEntry(**camera.document(), is_placed=True) for camera in placed]
