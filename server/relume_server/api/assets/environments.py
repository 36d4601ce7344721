"""/api/environments: import, list, show and delete environments for looks."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

from fastapi import APIRouter, File, Form, Response, UploadFile
from fastapi import Path as PathPart
from fastapi.concurrency import run_in_threadpool

from relume.assets.environments.built_in import BUILT_IN, load_built_in
from relume.assets.environments.environment_store import STORE, thumbnail_path
from relume.assets.environments.thumbnail import thumbnail
from relume.assets.small_asset_store import SmallAssetRecord
from relume_server.api.assets.upload import store_upload
from relume_server.api.pagination import NameFilter, PageDep
from relume_server.io.png import A_DAY, PngResponse
from relume_server.io.upload_middleware import ReservationDep
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import EnvironmentBody, format_timestamp
from relume_server.services import ServicesDep
from relume_worker.paths import environments_path

router = APIRouter(prefix="/api/environments", tags=["environments"])
MapFile = Annotated[UploadFile, File(description="equirectangular environment map, .hdr or .exr")]
MapName = Annotated[str, Form(max_length=200)]
AnyId = Annotated[str, PathPart(max_length=40, description="id of an imported environment, or name of a built-in one")]


@router.post("", status_code=201)
async def import_environment(
    environment: MapFile, services: ServicesDep, reservation: ReservationDep, response: Response, name: MapName = ""
) -> EnvironmentBody:
    """Import an environment in a separate process; the body has its name for looks."""
    identity = await store_upload(environment, name, "environment", reservation, services)
    response.headers["Location"] = f"/api/environments/{identity}"
    return await run_in_threadpool(get_environment, identity, services)


@router.get("")
def list_environments(services: ServicesDep, page: PageDep, name: NameFilter = None) -> list[EnvironmentBody]:
    """List the built-in environments, then the imported ones, newest first; filtered by name."""
    listed = [((0.0, float(index), example), _built_in_body(example)) for index, example in enumerate(BUILT_IN)]
    imported = STORE.list_records(environments_path(services.settings.data))
    listed += [((1.0, -record.created, record.id), _body(record)) for record in imported]
    named = [(key, body) for key, body in listed if name in (None, body.name)]
    return [body for _, body in page.cut(named, lambda keyed: keyed[0])]


@router.get("/{environment}")
def get_environment(environment: AnyId, services: ServicesDep) -> EnvironmentBody:
    """Return one environment."""
    if environment in BUILT_IN:
        return _built_in_body(environment)
    return _body(STORE.get_record(environments_path(services.settings.data), environment))


@router.get("/{environment}/thumbnail.png", response_class=PngResponse, name="get_environment_thumbnail")
async def get_thumbnail(environment: AnyId, services: ServicesDep) -> PngResponse:
    """Tone-mapped thumbnail, 192 × 96."""

    def read_thumbnail() -> bytes:
        if environment in BUILT_IN:
            return _built_in_thumbnail(environment)
        return thumbnail_path(environments_path(services.settings.data), environment).read_bytes()

    png = await services.pictures.run(("environment", environment), read_thumbnail)
    return PngResponse(png, headers=A_DAY)


@router.delete("/{environment}", status_code=204)
def delete_environment(environment: Id, services: ServicesDep) -> Response:
    """Delete an imported environment; looks that use it are no longer valid."""
    STORE.remove(environments_path(services.settings.data), environment)
    services.access.quotas.disown("environment", environment)
    return Response(status_code=204)


@lru_cache(maxsize=len(BUILT_IN))
def _built_in_thumbnail(name: str) -> bytes:
    return thumbnail(load_built_in(name).radiance)


def _built_in_body(name: str) -> EnvironmentBody:
    label, _ = BUILT_IN[name]
    return EnvironmentBody(
        id=name, map=name, name=label, created=None, warnings=[], thumbnail=f"/api/environments/{name}/thumbnail.png"
    )


def _body(record: SmallAssetRecord) -> EnvironmentBody:
    return EnvironmentBody(
        id=record.id,
        map=record.reference,
        name=record.name,
        created=format_timestamp(record.created),
        warnings=list(record.warnings),
        thumbnail=f"/api/environments/{record.id}/thumbnail.png",
    )
