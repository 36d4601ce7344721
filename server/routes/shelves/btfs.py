"""/api/materials/btf: list, show and delete BTFs; `relume material` makes and imports them, which takes minutes."""

from __future__ import annotations

from fastapi import APIRouter, Response

from relume.btf.shelf import STORE, BtfRecord, get_record, records
from server.files.png import A_DAY, PngResponse
from server.routes.paging import NameFilter, Paged, records_page
from server.routes.shelves.in_use import remove_unused
from server.routes.shelves.materials import terms_of, thumbnail_of
from server.services import Shared
from server.wire.bodies import BtfBody, moment
from server.wire.body import Id
from worker.paths import btfs_path

router = APIRouter(prefix="/api/materials/btf", tags=["materials"])


@router.get("")
def list_btfs(services: Shared, page: Paged, name: NameFilter = None) -> list[BtfBody]:
    """BTFs, newest first, or those of a name."""
    return [_body(record) for record in records_page(records(btfs_path(services.settings.data)), name, page)]


@router.get("/{material}")
def get_btf(material: Id, services: Shared) -> BtfBody:
    """One BTF."""
    return _body(get_record(btfs_path(services.settings.data), material))


@router.get("/{material}/thumbnail.png", response_class=PngResponse)
async def get_btf_thumbnail(material: Id, services: Shared) -> PngResponse:
    """A ball that is covered with it."""
    folder = btfs_path(services.settings.data)
    png = await services.pictures.make((folder, material), lambda: thumbnail_of(get_record(folder, material)))
    return PngResponse(png, headers=A_DAY)


@router.delete("/{material}", status_code=204)
async def delete_btf(material: Id, services: Shared) -> Response:
    """Delete a BTF that no saved look, link, session of this server or work under way names."""
    await remove_unused(STORE, btfs_path(services.settings.data), material, "btf", services)
    return Response(status_code=204)


def _body(record: BtfRecord) -> BtfBody:
    return BtfBody(
        id=record.id,
        data=record.data,
        name=record.name,
        created=moment(record.created),
        terms=terms_of(record),
        thumbnail=f"/api/materials/btf/{record.id}/thumbnail.png",
        synthetic=record.synthetic,
        size=record.size,
        directions=record.directions,
        clusters=record.clusters,
        components=record.components,
        error=record.error,
        ratio=record.ratio,
    )
