"""/api/materials/btf/jobs: render or import BTFs, which takes minutes; follow, stop and resume these jobs."""

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

from relume.assets.asset_store import check_name
from relume.synthetic_btf.synthesize import MESH, planned_bytes
from relume_server.api.job_lists import UserName, format_timestamps, list_jobs
from relume_server.api.pagination import MAX_LISTED, PageDep
from relume_server.auth.reservations import Reservation
from relume_server.auth.roles import CallerDep
from relume_server.batch.btf_steps import UPLOAD_FILE
from relume_server.io.import_request import UPLOAD_PREFIX, ImportRequest
from relume_server.io.upload_middleware import ReservationDep
from relume_server.io.uploads import plain_stem, save_upload, upload_bytes
from relume_server.jobs.btf_jobs import BtfJob
from relume_server.schemas.base import Id
from relume_server.schemas.btfs import BOUND, TEXELS, Bound, BtfJobBody, BtfRequest, Period, SyntheticBtfRequest, Texels
from relume_server.services import Services, ServicesDep
from relume_worker.job_state import JobState
from relume_worker.jobs.job import JobFilter, new_id

PREFIX = "/api/materials/btf/jobs"
router = APIRouter(prefix=PREFIX, tags=["materials"])
ImagesFile = Annotated[
    UploadFile, File(description=".zip of images named by light and view (UBO2003), or .btf container (UBO2014)")
]
MeshFile = Annotated[
    UploadFile,
    File(description="mesh of one period, +Y up: .glb, .obj, .ply, or .zip with materials"),
]
BtfName = Annotated[str, Form(max_length=200)]
BoundField = Annotated[Bound, Form()]


@router.post("", status_code=202)
async def import_btf(
    images: ImagesFile,
    services: ServicesDep,
    reservation: ReservationDep,
    response: Response,
    name: BtfName = "",
    error: BoundField = BOUND,
) -> BtfJobBody:
    """Queue the import of a ZIP of images or of a .btf container; the job validates the file."""
    identity = await run_in_threadpool(_submit_images, images, name, error, reservation, services)
    return await run_in_threadpool(_answer, identity, services, response)


def _submit_images(images: UploadFile, name: str, error: float, reservation: Reservation, services: Services) -> str:
    request = BtfRequest(name=check_name(name or plain_stem(images.filename) or "BTF"), error=error)
    with tempfile.TemporaryDirectory(dir=services.settings.data, prefix=UPLOAD_PREFIX) as folder:
        path = save_upload(images, Path(folder) / UPLOAD_FILE)
        return _submit(
            request, upload_bytes(images), reservation, services, lambda into: shutil.move(path, into / UPLOAD_FILE)
        )


def _submit(
    request: BtfRequest,
    num_bytes: int,
    reservation: Reservation,
    services: Services,
    prepare: Callable[[Path], object] | None = None,
) -> str:
    """Queue a job with its owner assigned first, because it may finish before the next line runs."""
    identity = new_id()
    with reservation.owner_assigned("btf-job", identity, num_bytes):
        return services.btfs.submit(request, reservation.owner, prepare, identity)


@router.post("/synthetic", status_code=202)
async def make_synthetic_btf(
    request: SyntheticBtfRequest, services: ServicesDep, caller: CallerDep, response: Response
) -> BtfJobBody:
    """Queue the rendering of a synthetic BTF from a built-in geometry."""
    name = check_name(request.name or f"{request.geometry.capitalize()} (synthetic)")
    btf_request = BtfRequest(name=name, error=request.error, geometry=request.geometry, size=request.size)
    num_bytes = planned_bytes(request.size)  # until it is ready
    async with services.import_queue.reserving(caller.name, num_bytes) as reservation:
        identity = await run_in_threadpool(_submit, btf_request, num_bytes, reservation, services)
    return await run_in_threadpool(_answer, identity, services, response)


@router.post("/geometry", status_code=202)
async def make_btf_from_mesh(
    geometry: MeshFile,
    services: ServicesDep,
    reservation: ReservationDep,
    response: Response,
    period: Annotated[Period | None, Form()] = None,
    size: Annotated[Texels, Form()] = TEXELS,
    name: BtfName = "",
    error: BoundField = BOUND,
) -> BtfJobBody:
    """Queue the rendering of a synthetic BTF from an uploaded mesh, which is validated first."""
    stem = name or f"{plain_stem(geometry.filename) or 'Mesh'} (synthetic)"
    btf_request = BtfRequest(name=check_name(stem), error=error, geometry=MESH, size=size, period=period)
    identity = await services.import_queue.run_in_slot(
        reservation.owner, partial(_submit_mesh, geometry, btf_request, reservation, services)
    )
    return await run_in_threadpool(_answer, identity, services, response)


def _submit_mesh(mesh: UploadFile, btf_request: BtfRequest, reservation: Reservation, services: Services) -> str:
    with tempfile.TemporaryDirectory(dir=services.settings.data, prefix=UPLOAD_PREFIX) as folder:
        path = save_upload(mesh, Path(folder) / UPLOAD_FILE)
        import_request = ImportRequest.create(services.settings, "tile", path, btf_request.name)
        services.import_queue.read(reservation, replace(import_request, period=btf_request.period), Path(folder))
        num_bytes = upload_bytes(mesh) + planned_bytes(btf_request.size)
        reservation.reserve(num_bytes)
        return _submit(
            btf_request, num_bytes, reservation, services, lambda into: shutil.move(path, into / UPLOAD_FILE)
        )


def _answer(identity: str, services: Services, response: Response) -> BtfJobBody:
    response.headers["Location"] = f"{PREFIX}/{identity}"
    return _body(services.btfs.get(identity), services)


@router.get("")
def list_btf_jobs(
    services: ServicesDep,
    page: PageDep,
    state: Annotated[JobState | None, Query()] = None,
    user: Annotated[UserName | None, Query()] = None,
) -> list[BtfJobBody]:
    """List BTF jobs, oldest first."""
    jobs = list_jobs(services.btfs, JobFilter(state, user), page, MAX_LISTED, newest_first=False)
    return [_body(job, services) for job in jobs]


@router.get("/{job}")
def get_btf_job(job: Id, services: ServicesDep) -> BtfJobBody:
    """State and progress of a BTF job."""
    return _body(services.btfs.get(job), services)


@router.delete("/{job}", status_code=204)
def stop_btf_job(job: Id, services: ServicesDep, delete_files: bool = False) -> Response:
    """Stop a job; its partial results are saved, unless `delete_files` is true. A finished BTF stays."""
    (services.btfs.delete if delete_files else services.btfs.stop)(job)
    if delete_files:
        services.access.quotas.disown("btf-job", job)
    return Response(status_code=204)


@router.post("/{job}/resume", status_code=202)
def resume_btf_job(job: Id, services: ServicesDep) -> BtfJobBody:
    """Resume a stopped job."""
    services.access.quotas.check_room()
    services.btfs.resume(job)
    return _body(services.btfs.get(job), services)


def _body(job: BtfJob, services: Services) -> BtfJobBody:
    request = job.request
    material = services.btfs.material(job.id) if job.state == "ready" else None
    return BtfJobBody.from_object(
        job, name=request.name, geometry=request.geometry, material=material, **format_timestamps(job)
    )
