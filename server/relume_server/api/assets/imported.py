"""/api/materials/imported: import, list, show and delete files with materials, such as MaterialX documents."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Response, UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.brdf.texture_slots import IMAGES, is_user_image
from relume.core.errors import NotFoundError
from relume.images.image_store import load_texture
from relume.imported_materials.material_store import STORE, ImportedRecord, get_record, records
from relume_server.api.assets.in_use import remove_unused
from relume_server.api.assets.upload import store_upload
from relume_server.api.pagination import NameFilter, PageDep, records_page
from relume_server.io.png import A_DAY, PngResponse
from relume_server.io.upload_middleware import ReservationDep
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import ImportedBody, LibraryMaterialBody, SceneWarning, format_timestamp
from relume_server.services import ServicesDep
from relume_worker.paths import imported_materials_path

router = APIRouter(prefix="/api/materials/imported", tags=["materials"])
MaterialFile = Annotated[UploadFile, File(description="MaterialX .mtlx, or a .zip with one and its images")]
MaterialName = Annotated[str, Form(max_length=200)]


@router.post("", status_code=201)
async def import_materials(
    material: MaterialFile,
    services: ServicesDep,
    reservation: ReservationDep,
    response: Response,
    name: MaterialName = "",
) -> ImportedBody:
    """Import the materials of a file in a separate process; their images are stored as `/api/images`."""
    identity = await store_upload(material, name, "imported", reservation, services)
    response.headers["Location"] = f"/api/materials/imported/{identity}"
    return await run_in_threadpool(get_imported, identity, services)


@router.get("")
def list_imported(services: ServicesDep, page: PageDep, name: NameFilter = None) -> list[ImportedBody]:
    """List imported files, newest first, filtered by name."""
    folder = imported_materials_path(services.settings.data)
    return [_body(record) for record in records_page(records(folder), name, page)]


@router.get("/{material}")
def get_imported(material: Id, services: ServicesDep) -> ImportedBody:
    """Return one imported file."""
    return _body(get_record(imported_materials_path(services.settings.data), material))


@router.get("/{material}/{index}/thumbnail.png", response_class=PngResponse, name="get_imported_thumbnail")
async def get_thumbnail(material: Id, index: int, services: ServicesDep) -> PngResponse:
    """Ball of a material of the file, by its index there."""
    folder = imported_materials_path(services.settings.data)
    png = await services.pictures.run((folder, material, index), lambda: _render_thumbnail(folder, material, index))
    return PngResponse(png, headers=A_DAY)


@router.delete("/{material}", status_code=204)
async def delete_imported(material: Id, services: ServicesDep) -> Response:
    """Delete an imported file. Looks that use its materials, and its images, stay."""
    folder = imported_materials_path(services.settings.data)
    await remove_unused(STORE, folder, material, "imported", services)
    return Response(status_code=204)


@lru_cache(maxsize=256)
def _render_thumbnail(folder: Path, identity: str, index: int) -> bytes:
    from relume.output.material_previews.preview import preview_png  # imports compiled kernels

    materials = get_record(folder, identity).materials
    if not 0 <= index < len(materials):
        raise NotFoundError(f"the file has {len(materials)} materials; give an index from 0 to {len(materials) - 1}")
    terms = materials[index].terms
    names = {term["texture"] for term in terms if is_user_image(term["texture"])}
    return preview_png(terms, {name: load_texture(name) for name in names if IMAGES.exists(name)})


def _body(record: ImportedRecord) -> ImportedBody:
    return ImportedBody(
        id=record.id,
        name=record.name,
        created=format_timestamp(record.created),
        materials=[
            LibraryMaterialBody(
                name=material.name,
                terms=material.terms,
                normal_map=material.look.get("normal_map"),
                glass=material.look.get("glass"),
                thumbnail=f"/api/materials/imported/{record.id}/{index}/thumbnail.png",
            )
            for index, material in enumerate(record.materials)
        ],
        warnings=[SceneWarning(**warning.document()) for warning in record.warnings],
    )
