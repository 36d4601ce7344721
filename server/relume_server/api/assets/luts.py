"""/api/luts: upload, list, show and delete LUTs of display values."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, File, Form, Response, UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.luts.lut_store import LUTS, LutRecord, load_table
from relume_server.api.assets.in_use import remove_unused
from relume_server.api.assets.upload import store_upload
from relume_server.api.color import LutResponse
from relume_server.api.pagination import NameFilter, PageDep, records_page
from relume_server.io.png import FOREVER
from relume_server.io.upload_middleware import ReservationDep
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import format_timestamp
from relume_server.schemas.luts import LutBody
from relume_server.services import ServicesDep
from relume_worker.paths import luts_path

router = APIRouter(prefix="/api/luts", tags=["luts"])
CubeFile = Annotated[UploadFile, File(description="a LUT of display values: .cube, 1D or 3D")]
LutName = Annotated[str, Form(max_length=200)]


@router.post("", status_code=201)
async def import_lut(
    lut: CubeFile, services: ServicesDep, reservation: ReservationDep, response: Response, name: LutName = ""
) -> LutBody:
    """Store a LUT, which is read in a separate process; the body has its name for looks."""
    identity = await store_upload(lut, name, "lut", reservation, services)
    response.headers["Location"] = f"/api/luts/{identity}"
    return await run_in_threadpool(describe_lut, identity, services)


@router.get("")
def list_luts(services: ServicesDep, page: PageDep, name: NameFilter = None) -> list[LutBody]:
    """List LUTs, newest first, filtered by name."""
    return [_body(record) for record in records_page(LUTS.list_records(luts_path(services.settings.data)), name, page)]


@router.get("/{lut}")
def describe_lut(lut: Id, services: ServicesDep) -> LutBody:
    """Return one LUT."""
    return _body(LUTS.get_record(luts_path(services.settings.data), lut))


@router.get("/{lut}/table", response_class=LutResponse)
def get_table(lut: Id) -> Response:
    """Its table: size x size x size x 3 numbers of 16 bits (docs/api.md)."""
    return LutResponse(load_table(LUTS.prefix + lut).astype("<u2").tobytes(), headers=FOREVER)


@router.delete("/{lut}", status_code=204)
async def delete_lut(lut: Id, services: ServicesDep) -> Response:
    """Delete a LUT, if no saved look, share link, session or job uses it."""
    folder = luts_path(services.settings.data)
    record = await run_in_threadpool(LUTS.get_record, folder, lut)
    await remove_unused(LUTS, folder, lut, "lut", services, called=f"LUT {record.name!r}")
    return Response(status_code=204)


def _body(record: LutRecord) -> LutBody:
    return LutBody(
        id=record.id,
        lut=record.reference,
        name=record.name,
        created=format_timestamp(record.created),
        size=record.size,
        warnings=list(record.warnings),
    )
