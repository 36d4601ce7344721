"""Cameras that users placed in a scene, besides those of its file."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from sqlalchemy import delete, func, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from relume.core.errors import NotFoundError, ParameterError
from relume.scene.custom_camera import CustomCamera, read_custom_camera
from relume.scene.model import Camera
from relume.scene.scene_folder import load_cameras
from relume_worker.database.models import CameraRow
from relume_worker.ledger import Ledger
from relume_worker.scenes import SceneRecord, get_scene

Views: TypeAlias = tuple[tuple[str, ...], tuple[CustomCamera, ...]]
"""Names of views, and the custom cameras among them, as in a recipe."""

MAX_CAMERAS = 200  # placed cameras per scene


def list_cameras(ledger: Ledger, scene_id: str) -> list[CustomCamera]:
    """Placed cameras of a scene, by name."""
    with ledger.sessions() as session:
        rows = session.scalars(select(CameraRow).where(CameraRow.scene_id == scene_id).order_by(CameraRow.name))
        return [read_custom_camera(json.loads(row.document)) for row in rows]


def camera_names_by_scene(ledger: Ledger) -> dict[str, list[str]]:
    """Names of placed cameras by scene, sorted."""
    names: dict[str, list[str]] = defaultdict(list)
    with ledger.sessions() as session:
        for scene_id, name in session.execute(select(CameraRow.scene_id, CameraRow.name).order_by(CameraRow.name)):
            names[scene_id].append(name)
    return names


def get_camera(folder: Path, ledger: Ledger, scene_id: str, name: str | None) -> Camera:
    """Return a camera of the file or a placed one; without a name, the first of the file.

    Args:
        folder: of the scene. ledger: ledger with the placed cameras. scene_id: id of the scene. name: of the camera.
    Raises:
        NotFoundError: the scene has no such camera. SceneError: its cameras cannot be read.
    """
    cameras = load_cameras(folder)
    if name is None:
        return cameras[0]
    placed = [camera.camera for camera in list_cameras(ledger, scene_id)]
    for camera in (*cameras, *placed):
        if camera.name == name:
            return camera
    raise NotFoundError(f"the scene has no camera {name[:80]!r}; place it first")


def store_camera(ledger: Ledger, scene_id: str, camera: CustomCamera) -> bool:
    """Store a camera under its name; bakes of its previous version are unchanged.

    Args:
        ledger: ledger of the scene. scene_id: id of the scene. camera: camera, with its name.
    Returns:
        True if the name is new.
    Raises:
        NotFoundError: there is no such scene. ParameterError: a camera of the file has this name, or there are too
            many.
    """
    _reject_scene_camera(get_scene(ledger, scene_id), camera.name)
    new_row = CameraRow(scene_id=scene_id, name=camera.name, document=json.dumps(camera.document()))
    try:
        with ledger.sessions.begin() as session:
            row = session.get(CameraRow, (scene_id, camera.name))
            if row is None and _count(session, scene_id) >= MAX_CAMERAS:
                allowed = f"the name of one of the {MAX_CAMERAS} cameras, or delete one"
                raise ParameterError("name", camera.name, allowed)
            session.merge(new_row)
    except IntegrityError:
        get_scene(ledger, scene_id)  # deleted at this moment
        return False  # or stored under this name by someone else
    return row is None


def delete_camera(ledger: Ledger, scene_id: str, name: str) -> None:
    """Delete a placed camera.

    Args:
        ledger: ledger of the scene. scene_id: id of the scene. name: name of the camera.
    Raises:
        NotFoundError: there is none. ParameterError: a camera of the file has this name.
    """
    _reject_scene_camera(get_scene(ledger, scene_id), name)
    with ledger.sessions.begin() as session:
        statement = (
            delete(CameraRow).where(CameraRow.scene_id == scene_id, CameraRow.name == name).returning(CameraRow.name)
        )
        if session.scalars(statement).first() is None:
            raise NotFoundError(f"the scene has no camera {name[:80]!r} that a user placed; place it first")


def resolve_views(ledger: Ledger, record: SceneRecord, requested: Sequence[str | CustomCamera]) -> Views:
    """Resolve the views of a recipe.

    Args:
        ledger: ledger with the placed cameras. record: record of the scene.
        requested: names of file or placed cameras, or cameras; empty: all cameras of the file.
    Returns:
        Names of all views, each once, in order; and the custom cameras among them.
    Raises:
        ParameterError: there is no such view, or two cameras have one name.
    """
    stored = {camera.name: camera for camera in list_cameras(ledger, record.id)}
    custom_cameras: dict[str, CustomCamera] = {}
    for view in requested:
        if isinstance(view, str) and view not in record.views and view not in stored:
            raise ParameterError("views", view, "some of " + ", ".join((*record.views, *stored))[:400])
        camera = stored.get(view) if isinstance(view, str) else view
        if camera is None:
            continue
        _reject_scene_camera(record, camera.name)
        if custom_cameras.setdefault(camera.name, camera) != camera:
            raise ParameterError("views", camera.name, "a different name for each camera")
    names = dict.fromkeys(view if isinstance(view, str) else view.name for view in requested or record.views)
    return tuple(names), tuple(custom_cameras.values())


def _reject_scene_camera(record: SceneRecord, name: str) -> None:
    if name in record.views:
        raise ParameterError("name", name, "a name that no camera of the scene's file has")


def _count(session: Session, scene_id: str) -> int:
    return session.scalar(select(func.count()).select_from(CameraRow).where(CameraRow.scene_id == scene_id)) or 0
