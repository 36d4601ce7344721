"""/api/bakes/{id}/probes: immutable data of a bake with which a browser draws free-camera views itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response
from fastapi.concurrency import run_in_threadpool
from numpy.typing import NDArray

from relume.core.errors import NotFoundError
from relume.live.fixed_camera.protocols import CameraMode, OpenBake
from relume_server.api.bakes import require_ready_bake
from relume_server.io.png import FOREVER
from relume_server.schemas.base import Id
from relume_server.schemas.probes import FreeCameraBody
from relume_server.services import ServicesDep

router = APIRouter(prefix="/api/bakes", tags=["bakes"])


Layout = Annotated[int | None, Query(description="only makes the URL change between releases with different arrays")]


class ArrayResponse(Response):
    """Numbers, little-endian, row-major."""

    media_type = "application/octet-stream"


@router.get("/{bake}/probes")
async def describe_probes(bake: Id, services: ServicesDep, response: Response, layout: Layout = None) -> FreeCameraBody:
    """Constants for the shaders of free-camera views, and the names of their arrays."""
    await run_in_threadpool(require_ready_bake, services, bake)
    async with services.transfers.acquire(bake, services.bakes.store_path(bake)) as transfer:
        constants, arrays = services.live.library.shader_arrays(_require_free_camera(transfer))
    response.headers.update(FOREVER)
    return FreeCameraBody(**constants, arrays=list(arrays))


@router.get("/{bake}/probes/{array}", response_class=ArrayResponse)
async def get_probe_array(
    bake: Id, array: Annotated[str, Path(max_length=64)], services: ServicesDep, layout: Layout = None
) -> Response:
    """One array: texels of 1, 2 or 4 numbers (docs/api.md)."""
    await run_in_threadpool(require_ready_bake, services, bake)
    async with services.transfers.acquire(bake, services.bakes.store_path(bake)) as transfer:
        _, arrays = services.live.library.shader_arrays(_require_free_camera(transfer))
        read_array = partial(_read_array, arrays, array)
        return await services.responses.stream((bake, array), read_array, ArrayResponse.media_type, FOREVER)


def _require_free_camera(transfer: OpenBake) -> OpenBake:
    if transfer.camera_mode is not CameraMode.FREE:
        raise NotFoundError("this bake has fixed cameras; bake the scene with method probes for a free camera")
    return transfer


def _read_array(arrays: Mapping[str, Callable[[], NDArray[Any]]], name: str) -> NDArray[Any]:
    if name not in arrays:
        raise NotFoundError(f"there is no array {name[:40]!r}; choose from {', '.join(arrays)}")
    return arrays[name]()
