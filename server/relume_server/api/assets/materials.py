"""/api/materials/measured: import, list, show and delete measured materials."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Any

from fastapi import APIRouter, File, Form, Response, UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.assets.btf.btf_store import BtfRecord
from relume.assets.measured.measured_store import STORE, MaterialRecord, get_record, records
from relume.brdf.term_validation import complete_term
from relume_server.api.assets.in_use import remove_unused
from relume_server.api.assets.upload import store_upload
from relume_server.api.pagination import NameFilter, PageDep, records_page
from relume_server.io.png import A_DAY, PngResponse
from relume_server.io.upload_middleware import ReservationDep
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import MeasuredBody, format_timestamp
from relume_server.services import ServicesDep
from relume_worker.paths import materials_path

router = APIRouter(prefix="/api/materials/measured", tags=["materials"])
MaterialFile = Annotated[UploadFile, File(description="MERL .binary, RGL .bsdf or Cornell .brdf")]
MaterialName = Annotated[str, Form(max_length=200)]


@router.post("", status_code=201)
async def import_measured(
    material: MaterialFile,
    services: ServicesDep,
    reservation: ReservationDep,
    response: Response,
    name: MaterialName = "",
) -> MeasuredBody:
    """Import a MERL, RGL or Cornell file in a separate process; the body has its name for looks."""
    identity = await store_upload(material, name, "material", reservation, services)
    response.headers["Location"] = f"/api/materials/measured/{identity}"
    return await run_in_threadpool(get_measured, identity, services)


@router.get("")
def list_measured(services: ServicesDep, page: PageDep, name: NameFilter = None) -> list[MeasuredBody]:
    """List measured materials, newest first, filtered by name."""
    return [_body(record) for record in records_page(records(materials_path(services.settings.data)), name, page)]


@router.get("/{material}")
def get_measured(material: Id, services: ServicesDep) -> MeasuredBody:
    """Return one measured material."""
    return _body(get_record(materials_path(services.settings.data), material))


@router.get("/{material}/thumbnail.png", response_class=PngResponse, name="get_measured_thumbnail")
async def get_thumbnail(material: Id, services: ServicesDep) -> PngResponse:
    """Ball of the material."""
    folder = materials_path(services.settings.data)
    png = await services.pictures.run((folder, material), lambda: render_thumbnail(get_record(folder, material)))
    return PngResponse(png, headers=A_DAY)


@lru_cache(maxsize=256)
def render_thumbnail(record: MaterialRecord | BtfRecord) -> bytes:
    """Render the ball of a material as PNG."""
    from relume.output.material_previews.preview import preview_png  # imports compiled kernels

    return preview_png(complete_terms(record))


@router.delete("/{material}", status_code=204)
async def delete_measured(material: Id, services: ServicesDep) -> Response:
    """Delete a measured material that no saved look, share link, session of this server or running job uses."""
    await remove_unused(STORE, materials_path(services.settings.data), material, "material", services)
    return Response(status_code=204)


def complete_terms(record: MaterialRecord | BtfRecord) -> list[dict[str, Any]]:
    """Complete terms of the material."""
    return [complete_term(("measured", k), term, None) for k, term in enumerate(record.terms())]


def _body(record: MaterialRecord) -> MeasuredBody:
    return MeasuredBody(
        id=record.id,
        data=record.data,
        name=record.name,
        created=format_timestamp(record.created),
        terms=complete_terms(record),
        thumbnail=f"/api/materials/measured/{record.id}/thumbnail.png",
        lobes_error=record.lobes_error,
        homomorphic_error=record.homomorphic_error,
        warnings=list(record.warnings),
    )
