"""/api/scenes/{id}/cameras: cameras that users place in a scene; bakes refer to them by name."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Response

from relume.core.errors import NotFoundError
from relume.scene.scene_folder import load_cameras
from relume_server.api.pagination import PageDep
from relume_server.schemas.base import MAX_NAME, Id
from relume_server.schemas.cameras import CameraEntry, FixedCameraFrame
from relume_server.services import Services, ServicesDep
from relume_worker.cameras import delete_camera, list_cameras, store_camera
from relume_worker.paths import scene_path
from relume_worker.scenes import get_scene
from relume_worker.storage import fetch_if_missing

router = APIRouter(prefix="/api/scenes/{scene}/cameras", tags=["scenes"])
CameraName = Annotated[str, Path(min_length=1, max_length=MAX_NAME)]


@router.get("", name="list_cameras")
def get_cameras(scene: Id, services: ServicesDep, page: PageDep) -> list[CameraEntry]:
    """List the cameras of the file, then the placed ones, by name."""
    return page.in_order(_entries(scene, services))


@router.get("/{name}")
def get_camera(scene: Id, name: CameraName, services: ServicesDep) -> CameraEntry:
    """Return one camera."""
    for entry in _entries(scene, services):
        if entry.name == name:
            return entry
    raise NotFoundError(f"the scene has no camera {name[:80]!r}; place it first")


@router.put("/{name}", status_code=204, responses={201: {"description": "Created"}, 204: {"description": "Replaced"}})
def put_camera(scene: Id, name: CameraName, frame: FixedCameraFrame, services: ServicesDep) -> Response:
    """Store a camera under a name: 201 if it is new. Bakes of its previous version are unchanged."""
    is_new = store_camera(services.bakes.ledger, scene, frame.custom_camera(name))
    return Response(status_code=201 if is_new else 204)


@router.delete("/{name}", status_code=204, name="delete_camera")
def delete_placed_camera(scene: Id, name: CameraName, services: ServicesDep) -> Response:
    """Delete a placed camera; its bakes are unchanged."""
    delete_camera(services.bakes.ledger, scene, name)
    return Response(status_code=204)


def _entries(scene: str, services: Services) -> list[CameraEntry]:
    record = get_scene(services.bakes.ledger, scene)
    scene_cameras = [
        CameraEntry(**FixedCameraFrame.from_camera(c).model_dump(), name=c.name, is_placed=False)
        for c in load_cameras(fetch_if_missing(scene_path(services.settings.data, record.id)))
    ]
    placed_cameras = list_cameras(services.bakes.ledger, record.id)
    return scene_cameras + [CameraEntry(**camera.document(), is_placed=True) for camera in placed_cameras]
