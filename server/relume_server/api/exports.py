"""/api/scenes/{id}/exports: a scene with a look as a file, and its report before."""

from __future__ import annotations

import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from fastapi import APIRouter
from fastapi.concurrency import run_in_threadpool
from starlette.background import BackgroundTask

from relume.core.errors import ParameterError
from relume.core.folder_size import folder_bytes
from relume.export.export_document import ExportDocument, light_mix_warnings, look_of_scene, prepare_export
from relume.export.export_scene import FORMATS, export_report
from relume.output.file_names import safe_stem
from relume.scene.scene_folder import load_scene
from relume_server.auth.roles import CallerDep
from relume_server.io.downloads import Download
from relume_server.io.import_request import UPLOAD_PREFIX
from relume_server.openapi import files
from relume_server.persistence.look_store import check_name
from relume_server.schemas.base import Id
from relume_server.schemas.exports import ExportReportBody, ExportRequest
from relume_server.services import Services, ServicesDep
from relume_worker.paths import scene_path
from relume_worker.scenes import get_scene
from relume_worker.storage import fetch_if_missing

router = APIRouter(prefix="/api/scenes/{scene}/exports", tags=["scenes"])
_LARGEST_RATIO = 2  # of a file to the scene, whose arrays it contains


@router.post("", response_class=Download, responses=files(*(each.media_type for each in FORMATS.values())))
async def export_scene(scene: Id, request: ExportRequest, services: ServicesDep, caller: CallerDep) -> Download:
    """Return the file; it is stored until it is sent."""
    file_format, record = FORMATS[request.format], await run_in_threadpool(get_scene, services.bakes.ledger, scene)
    num_bytes = _LARGEST_RATIO * await run_in_threadpool(folder_bytes, scene_path(services.settings.data, scene))
    folder = Path(tempfile.mkdtemp(dir=services.settings.data, prefix=UPLOAD_PREFIX))
    path = folder / f"export{file_format.suffix}"

    def write() -> None:
        file_format.write(_prepare(scene, request, services), path)

    try:
        async with services.import_queue.reserving(caller.name, num_bytes):
            await services.import_queue.run_in_slot(caller.name, write)
    except BaseException:
        await run_in_threadpool(shutil.rmtree, folder, ignore_errors=True)
        raise
    return Download(
        path,
        filename=f"{safe_stem(record.name)}{file_format.suffix}",
        media_type=file_format.media_type,
        headers={"Cache-Control": "no-store"},
        background=BackgroundTask(shutil.rmtree, folder, ignore_errors=True),
    )


@router.post("/report", name="get_export_report")
async def get_report(scene: Id, request: ExportRequest, services: ServicesDep, caller: CallerDep) -> ExportReportBody:
    """Return the errors of fitted materials, and what the file will not have."""

    def report() -> dict[str, Any]:
        return export_report(_prepare(scene, request, services), FORMATS[request.format]).document()

    return ExportReportBody.model_validate(await services.import_queue.run_in_slot(caller.name, report))


def _prepare(scene: str, request: ExportRequest, services: Services) -> ExportDocument:
    """Load the scene and fit its materials."""
    if request.saved_look is not None and request.look:
        raise ParameterError("saved_look", request.saved_look, "it, or look, not both")
    record = get_scene(services.bakes.ledger, scene)
    loaded = load_scene(fetch_if_missing(scene_path(services.settings.data, record.id)))

    def saved(name: str) -> dict[str, Any]:
        document: dict[str, Any] = json.loads(services.looks.get(check_name(name)).document)
        return document

    document = request.look if request.saved_look is None else saved(request.saved_look)
    variants = {name: saved(name) for name in request.variants}
    looks = {name: look_of_scene(loaded, each, f"look {name!r}") for name, each in variants.items()}
    prepared = prepare_export(
        loaded, look_of_scene(loaded, document, "look"), looks, has_materials=FORMATS[request.format].has_materials
    )
    return replace(prepared, warnings=light_mix_warnings(loaded, [document, *variants.values()]))
