"""/api/materials/btf: list, show and delete BTFs; jobs or `relume material` make them, which takes minutes."""

from __future__ import annotations

from fastapi import APIRouter, Response

from relume.assets.btf.btf_memory import memory_bytes
from relume.assets.btf.btf_store import STORE, BtfRecord, get_record, records
from relume_server.api.assets.in_use import remove_unused
from relume_server.api.assets.materials import complete_terms, render_thumbnail
from relume_server.api.pagination import NameFilter, PageDep, records_page
from relume_server.io.png import A_DAY, PngResponse
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import BtfBody, format_timestamp
from relume_server.services import ServicesDep
from relume_worker.paths import btfs_path

router = APIRouter(prefix="/api/materials/btf", tags=["materials"])


@router.get("")
def list_btfs(services: ServicesDep, page: PageDep, name: NameFilter = None) -> list[BtfBody]:
    """List BTFs, newest first, filtered by name."""
    return [_body(record) for record in records_page(records(btfs_path(services.settings.data)), name, page)]


@router.get("/{material}")
def get_btf(material: Id, services: ServicesDep) -> BtfBody:
    """Return one BTF."""
    return _body(get_record(btfs_path(services.settings.data), material))


@router.get("/{material}/thumbnail.png", response_class=PngResponse)
async def get_btf_thumbnail(material: Id, services: ServicesDep) -> PngResponse:
    """Ball covered with the BTF."""
    folder = btfs_path(services.settings.data)
    png = await services.pictures.run((folder, material), lambda: render_thumbnail(get_record(folder, material)))
    return PngResponse(png, headers=A_DAY)


@router.delete("/{material}", status_code=204)
async def delete_btf(material: Id, services: ServicesDep) -> Response:
    """Delete a BTF that no saved look, share link, session of this server or running job uses."""
    await remove_unused(STORE, btfs_path(services.settings.data), material, "btf", services)
    return Response(status_code=204)


def _body(record: BtfRecord) -> BtfBody:
    return BtfBody(
        id=record.id,
        data=record.data,
        name=record.name,
        created=format_timestamp(record.created),
        terms=complete_terms(record),
        thumbnail=f"/api/materials/btf/{record.id}/thumbnail.png",
        synthetic=record.synthetic,
        size=record.size,
        directions=record.directions,
        clusters=record.clusters,
        components=record.components,
        error=record.error,
        ratio=record.ratio,
        memory_bytes=memory_bytes(record.size, record.directions, record.clusters, record.components),
    )
