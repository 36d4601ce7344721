"""Scene registry: scenes/<id>/ on disk, one row each in the ledger's database."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import delete, select
from sqlalchemy.exc import IntegrityError

from relume.assets.ies.ies_store import store_ies_files
from relume.core.errors import DiskFullError, NotFoundError
from relume.core.filesystem import remove_folder
from relume.core.import_warnings import ImporterWarning, warning_of
from relume.math.bounding_box import bounding_box
from relume.scene.model import Scene
from relume.scene.scene_folder import save_scene
from relume.scene.triplanar import find_triplanar
from relume_worker.database.models import CameraRow, SceneRow
from relume_worker.ledger import Ledger
from relume_worker.paths import bake_path, ies_path, scene_path, staging_path
from relume_worker.run_marker import delete_run
from relume_worker.storage import delete_remote, push

MAX_LISTED_OBJECTS = 2000


@dataclass(frozen=True)
class SceneRecord:
    """Summary of a scene, without its arrays.

    Attributes:
        created: seconds since 1970.
        views: camera names, in order. aspects: width ÷ height of each in its file, or None.
        materials: {"name", "terms", "shadow_catcher", "is_projected", "is_glass", "is_textured"} each, in the order of
            material ids; old ones lack the last four.
        variants: partial looks of the file, by name.
        lights: names of the scene's lights.
        objects: names of its meshes; empty if there are more than `MAX_LISTED_OBJECTS`, and in old rows.
        import_options: `relume.scene_io.import_options.ImportOptions` other than the defaults.
        size: sides of the bounding box without a shadow catcher, meters; None in old rows.
    """

    id: str
    name: str
    created: float
    views: tuple[str, ...]
    materials: tuple[dict[str, Any], ...]
    warnings: tuple[ImporterWarning, ...]
    num_triangles: int
    variants: dict[str, dict[str, Any]]
    lights: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    aspects: tuple[float | None, ...] = ()
    import_options: Mapping[str, str] = field(default_factory=dict)
    size: tuple[float, float, float] | None = None


def register_scene(data_dir: Path, ledger: Ledger, scene: Scene) -> str:
    """Store a scene; the same content is the same scene, with its newest name and warnings.

    Args:
        data_dir: data directory of scenes. ledger: ledger of scenes.
        scene: from an importer.
    Returns:
        The scene's id.
    """
    store_ies_files(ies_path(data_dir), scene.ies_files)
    save_scene(scene, scene_path(data_dir, scene.id))
    insert_scene(data_dir, ledger, scene.id, summarize_scene(scene))
    return scene.id


def summarize_scene(scene: Scene) -> dict[str, Any]:
    """Summarize a scene for lists, with its name."""
    listed = scene.meshes if len(scene.meshes) <= MAX_LISTED_OBJECTS else ()
    return {
        "name": scene.name,
        "views": [camera.name for camera in scene.cameras],
        "aspects": [camera.aspect for camera in scene.cameras],
        "materials": [
            {
                "name": material.name,
                "terms": list(material.terms),
                "shadow_catcher": material.shadow_catcher,
                "is_projected": is_triplanar,
                "is_glass": material.glass is not None,
                "is_textured": bool(material.textures) or material.normal_map is not None,
                "objects": list(dict.fromkeys(mesh.name for mesh in listed if mesh.material == index)),
            }
            for index, (material, is_triplanar) in enumerate(zip(scene.materials, find_triplanar(scene), strict=True))
        ],
        "warnings": [warning.document() for warning in scene.warnings],
        "num_triangles": sum(len(mesh.faces) for mesh in scene.meshes),
        "variants": scene.variants,
        "lights": [light.name for light in scene.lights],
        "profiles": sorted({profile for light in scene.lights if (profile := light.fields.get("profile"))}),
        "objects": [mesh.name for mesh in listed],
        "import_options": scene.import_options,
        "size": _size(scene),
    }


def _size(scene: Scene) -> list[float]:
    """Sides of the bounding box without a shadow catcher, if there is something else. Meters"""
    is_catcher = [scene.materials[mesh.material].shadow_catcher for mesh in scene.meshes]
    shown = [mesh for mesh, catches in zip(scene.meshes, is_catcher, strict=True) if not catches] or scene.meshes
    low, high = bounding_box(np.concatenate([bounding_box(mesh.positions) for mesh in shown]))
    return [float(side) for side in high - low]


def insert_scene(data_dir: Path, ledger: Ledger, scene_id: str, summary: Mapping[str, Any]) -> None:
    """Insert the row of a scene whose files are in place.

    Args:
        data_dir: data directory of scenes. ledger: ledger of scenes.
        scene_id: id of the scene. summary: see `summarize_scene`.
    """
    push(scene_path(data_dir, scene_id))
    row = SceneRow(id=scene_id, name=summary["name"], created=time.time(), summary=json.dumps(summary))
    try:
        with ledger.sessions.begin() as session:
            session.add(row)
    except IntegrityError:
        with ledger.sessions.begin() as session:
            if (existing := session.get(SceneRow, scene_id)) is not None:
                existing.name, existing.summary = summary["name"], json.dumps(summary)


def list_scenes(ledger: Ledger) -> list[SceneRecord]:
    """All scenes, newest first."""
    with ledger.sessions() as session:
        return [_record(row) for row in session.scalars(select(SceneRow).order_by(SceneRow.created.desc()))]


def last_import_options(ledger: Ledger, name: str) -> Mapping[str, str]:
    """Import options of the newest scene with a name, for an import of its changed file; empty without one."""
    return next((record.import_options for record in list_scenes(ledger) if record.name == name), {})


def get_scene(ledger: Ledger, scene_id: str) -> SceneRecord:
    """Return a scene. Raises NotFoundError."""
    with ledger.sessions() as session:
        row = session.get(SceneRow, scene_id)
    if row is None:
        raise NotFoundError(f"there is no scene {scene_id[:40]}; import it first")
    return _record(row)


def scenes_referencing(ledger: Ledger, text: str) -> list[str]:
    """Names of scenes whose lists contain a text, such as the IES file of a light, sorted; it has no wildcards."""
    with ledger.sessions() as session:
        query = select(SceneRow.name).where(SceneRow.summary.contains(text, autoescape=True))
        return sorted(session.scalars(query))


def delete_scene(data_dir: Path, ledger: Ledger, scene_id: str) -> None:
    """Delete a scene with its bakes and their stores, which are useless without it.

    Args:
        data_dir: data directory of scenes and stores. ledger: ledger of both.
        scene_id: id of the scene; its running bakes are canceled.
    Raises:
        NotFoundError: there is no such scene.
    """
    get_scene(ledger, scene_id)
    delete_bakes(data_dir, ledger, [status.id for status in ledger.bakes(scene_id)])
    while not _delete_scene_row(ledger, scene_id):  # a bake of it was submitted meanwhile
        delete_bakes(data_dir, ledger, [status.id for status in ledger.bakes(scene_id)])
    delete_remote(scene_path(data_dir, scene_id))
    _remove(scene_path(data_dir, scene_id))


def _delete_scene_row(ledger: Ledger, scene_id: str) -> bool:
    """Delete the row of a scene; false if there is a bake or a camera of it."""
    try:
        with ledger.sessions.begin() as session:
            session.execute(delete(CameraRow).where(CameraRow.scene_id == scene_id))
            session.execute(delete(SceneRow).where(SceneRow.id == scene_id))
    except IntegrityError:
        return False
    return True


def delete_bakes(data_dir: Path, ledger: Ledger, ids: Sequence[str]) -> None:
    """Delete bakes with their stores, finished or not.

    Args:
        data_dir: data directory of stores. ledger: ledger of bakes.
        ids: ids of bakes; running ones are canceled.
    """
    try:
        _delete_bake_rows(ledger, ids)
    except DiskFullError:  # deleting rows needs disk space, too: first free theirs
        _remove_stores(data_dir, ids)
        _delete_bake_rows(ledger, ids)
    for identity in ids:
        delete_remote(bake_path(data_dir, identity))
    _remove_stores(data_dir, ids)


def _delete_bake_rows(ledger: Ledger, ids: Sequence[str]) -> None:
    for identity in ids:
        ledger.cancel(identity)
    ledger.delete(ids)


def _remove_stores(data_dir: Path, ids: Sequence[str]) -> None:
    for identity in ids:
        _remove(bake_path(data_dir, identity))
        shutil.rmtree(staging_path(data_dir, identity), ignore_errors=True)
        delete_run(staging_path(data_dir, identity))


def _remove(store: Path) -> None:
    """Delete a store that no ledger names any more, if it exists."""
    with suppress(OSError):
        remove_folder(store)


def _record(row: SceneRow) -> SceneRecord:
    summary = json.loads(row.summary)
    return SceneRecord(
        id=row.id,
        name=row.name,
        created=row.created,
        views=tuple(summary["views"]),
        materials=tuple(summary["materials"]),
        warnings=tuple(warning_of(warning) for warning in summary["warnings"]),
        num_triangles=summary["num_triangles"],
        variants=summary.get("variants", {}),  # rows from before this field
        lights=tuple(summary.get("lights", ())),
        objects=tuple(summary.get("objects", ())),
        aspects=tuple(summary.get("aspects", ())),
        import_options=summary.get("import_options", {}),
        size=summary.get("size"),
    )
