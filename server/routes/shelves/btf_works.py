"""/api/materials/btf-works: BTFs are rendered or imported, which takes minutes; followed, stopped, gone on with."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Query, Response, UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.asset_store import check_name
from relume.synthetic.make import MESH
from server.access.reservations import Reservation
from server.access.roles import Who
from server.apart.btfs import SENT
from server.files.door import Held
from server.files.importing import UPLOAD_PREFIX, ImportRequest
from server.files.uploads import keep_upload, plain_stem, upload_bytes
from server.queues.btfs import BtfWork
from server.queues.work import WorkFilter, new_id
from server.routes.paging import MAX_LISTED, Paged
from server.routes.works import UserName, moments, work_page
from server.services import Services, Shared
from server.wire.body import Id, WorkState
from server.wire.btfs import BOUND, TEXELS, Bound, BtfRequest, BtfWorkBody, Period, SyntheticBtfRequest, Texels

PREFIX = "/api/materials/btf-works"
router = APIRouter(prefix=PREFIX, tags=["materials"])
ImagesFile = Annotated[
    UploadFile, File(description="zip of images named by light and view (UBO2003), or .btf container (UBO2014)")
]
MeshFile = Annotated[
    UploadFile,
    File(description="mesh of one period, seen from above (+Y): .glb, .obj, .ply, or .zip with materials"),
]
BtfName = Annotated[str, Form(max_length=200)]
BoundField = Annotated[Bound, Form()]


@router.post("", status_code=202)
async def import_btf(
    images: ImagesFile,
    services: Shared,
    held: Held,
    response: Response,
    name: BtfName = "",
    error: BoundField = BOUND,
) -> BtfWorkBody:
    """Queue the import of a zip of images or of a .btf container; what is wrong with it the work says."""
    identity = await run_in_threadpool(_submit_images, images, name, error, held, services)
    return await run_in_threadpool(_answer, identity, services, response)


def _submit_images(images: UploadFile, name: str, error: float, held: Reservation, services: Services) -> str:
    request = BtfRequest(name=check_name(name or plain_stem(images.filename) or "BTF"), error=error)
    with tempfile.TemporaryDirectory(dir=services.settings.data, prefix=UPLOAD_PREFIX) as folder:
        path = keep_upload(images, Path(folder) / SENT)
        return _submit(request, upload_bytes(images), held, services, lambda into: shutil.move(path, into / SENT))


def _submit(
    request: BtfRequest,
    num_bytes: int,
    held: Reservation,
    services: Services,
    prepare: Callable[[Path], object] | None = None,
) -> str:
    """Queue a work that is its caller's from the beginning: it may be done before the next line is reached."""
    identity = new_id()
    with held.owning("btf-work", identity, num_bytes):
        return services.btfs.submit(request, held.who, prepare, identity)


@router.post("/synthetic", status_code=202)
async def make_synthetic_btf(
    request: SyntheticBtfRequest, services: Shared, caller: Who, response: Response
) -> BtfWorkBody:
    """Queue the rendering of a small geometry from all sides in light from all sides."""
    name = check_name(request.name or f"{request.geometry.capitalize()} (synthetic)")
    wanted = BtfRequest(name=name, error=request.error, geometry=request.geometry, size=request.size)
    async with services.intake.reserving(caller.name, 1) as held:  # how many it will take is known when it is made
        identity = await run_in_threadpool(_submit, wanted, 0, held, services)
    return await run_in_threadpool(_answer, identity, services, response)


@router.post("/geometry", status_code=202)
async def make_btf_of_mesh(
    geometry: MeshFile,
    services: Shared,
    held: Held,
    response: Response,
    period: Annotated[Period | None, Form()] = None,
    size: Annotated[Texels, Form()] = TEXELS,
    name: BtfName = "",
    error: BoundField = BOUND,
) -> BtfWorkBody:
    """Queue the rendering of a small geometry that is sent; what is wrong with the mesh is said at once."""
    stem = name or f"{plain_stem(geometry.filename) or 'Mesh'} (synthetic)"
    wanted = BtfRequest(name=check_name(stem), error=error, geometry=MESH, size=size, period=period)
    identity = await services.intake.work(held.who, partial(_submit_mesh, geometry, wanted, held, services))
    return await run_in_threadpool(_answer, identity, services, response)


def _submit_mesh(mesh: UploadFile, wanted: BtfRequest, held: Reservation, services: Services) -> str:
    with tempfile.TemporaryDirectory(dir=services.settings.data, prefix=UPLOAD_PREFIX) as folder:
        path = keep_upload(mesh, Path(folder) / SENT)
        looked_at = ImportRequest.of(services.settings, "tile", path, wanted.name)
        services.intake.read(held, replace(looked_at, period=wanted.period), Path(folder))
        return _submit(wanted, upload_bytes(mesh), held, services, lambda into: shutil.move(path, into / SENT))


def _answer(identity: str, services: Services, response: Response) -> BtfWorkBody:
    response.headers["Location"] = f"{PREFIX}/{identity}"
    return _body(services.btfs.get(identity), services)


@router.get("")
def list_btf_works(
    services: Shared,
    page: Paged,
    state: Annotated[WorkState | None, Query()] = None,
    user: Annotated[UserName | None, Query()] = None,
) -> list[BtfWorkBody]:
    """Those that were asked for and not forgotten, oldest first."""
    works = work_page(services.btfs, WorkFilter(state, user), page, MAX_LISTED, newest_first=False)
    return [_body(work, services) for work in works]


@router.get("/{work}")
def get_btf_work(work: Id, services: Shared) -> BtfWorkBody:
    """State and progress."""
    return _body(services.btfs.get(work), services)


@router.delete("/{work}", status_code=204)
def stop_btf_work(work: Id, services: Shared, forget: bool = False) -> Response:
    """Stop it; what was found so far is kept, unless `forget` says that nobody needs it. A BTF that is ready stays."""
    (services.btfs.delete if forget else services.btfs.stop)(work)
    if forget:
        services.access.quotas.disown("btf-work", work)
    return Response(status_code=204)


@router.post("/{work}/resume", status_code=202)
def resume_btf_work(work: Id, services: Shared) -> BtfWorkBody:
    """Go on with what was stopped."""
    services.btfs.resume(work)
    return _body(services.btfs.get(work), services)


def _body(work: BtfWork, services: Services) -> BtfWorkBody:
    request = work.request
    material = services.btfs.material(work.id) if work.state == "ready" else None
    return BtfWorkBody.of(work, name=request.name, geometry=request.geometry, material=material, **moments(work))
