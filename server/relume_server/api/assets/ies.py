"""/api/ies: upload, list, show and delete IES files for point and spot lights."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, File, Form, Response, UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.assets.ies.ies_store import IES_FILES, IesRecord, load_planes
from relume_server.api.assets.in_use import remove_unused
from relume_server.api.assets.upload import store_upload
from relume_server.api.pagination import NameFilter, PageDep, records_page
from relume_server.io.upload_middleware import ReservationDep
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import format_timestamp
from relume_server.schemas.ies import IesBody
from relume_server.services import ServicesDep
from relume_worker.paths import ies_path

router = APIRouter(prefix="/api/ies", tags=["lights"])
IesFile = Annotated[UploadFile, File(description="an IES file: LM-63, type C")]
IesName = Annotated[str, Form(max_length=200)]


@router.post("", status_code=201)
async def import_ies(
    ies: IesFile, services: ServicesDep, reservation: ReservationDep, response: Response, name: IesName = ""
) -> IesBody:
    """Store an IES file, which is read in a separate process; the body has its name for lights of looks."""
    identity = await store_upload(ies, name, "ies", reservation, services)
    response.headers["Location"] = f"/api/ies/{identity}"
    return await run_in_threadpool(get_ies, identity, services)


@router.get("")
def list_ies(services: ServicesDep, page: PageDep, name: NameFilter = None) -> list[IesBody]:
    """List IES files, newest first, filtered by name."""
    return [
        _body(record) for record in records_page(IES_FILES.list_records(ies_path(services.settings.data)), name, page)
    ]


@router.get("/{ies}")
def get_ies(ies: Id, services: ServicesDep) -> IesBody:
    """Return one IES file."""
    return _body(IES_FILES.get_record(ies_path(services.settings.data), ies))


@router.delete("/{ies}", status_code=204)
async def delete_ies(ies: Id, services: ServicesDep) -> Response:
    """Delete an IES file that no scene, saved look, share link, session of this server or running job uses."""
    await remove_unused(IES_FILES, ies_path(services.settings.data), ies, "ies", services)
    return Response(status_code=204)


def _body(record: IesRecord) -> IesBody:
    return IesBody(
        id=record.id,
        profile=record.reference,
        name=record.name,
        created=format_timestamp(record.created),
        candela=record.candela,
        emission=record.emission,
        warnings=list(record.warnings),
        planes=load_planes(record.reference),
    )
