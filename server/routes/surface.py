"""/api/bakes/{id}/surface: what a browser keeps of a bake to draw its moving views itself; nothing of it changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response
from fastapi.concurrency import run_in_threadpool
from numpy.typing import NDArray

from relume.errors import NotFoundError
from relume.picture.transfer import Eyes, Opened
from server.files.png import FOREVER
from server.routes.bakes import ready_bake
from server.services import Shared
from server.wire.body import Id
from server.wire.surface import SurfaceBody

router = APIRouter(prefix="/api/bakes", tags=["bakes"])


Layout = Annotated[int | None, Query(description="only makes the address change when a release has other arrays")]


class ArrayResponse(Response):
    """Numbers, little-endian, row-major."""

    media_type = "application/octet-stream"


@router.get("/{bake}/surface")
async def describe_surface(bake: Id, services: Shared, response: Response, layout: Layout = None) -> SurfaceBody:
    """Of a moving view: what its shaders are written from, and the names of the arrays that they keep."""
    await run_in_threadpool(ready_bake, services, bake)
    async with services.transfers.using(bake, services.bakes.store_path(bake)) as transfer:
        constants, arrays = services.live.library.shader_arrays(_moving(transfer))
    response.headers.update(FOREVER)
    return SurfaceBody(**constants, arrays=list(arrays))


@router.get("/{bake}/surface/{array}", response_class=ArrayResponse)
async def surface_array(
    bake: Id, array: Annotated[str, Path(max_length=64)], services: Shared, layout: Layout = None
) -> Response:
    """One of them: so many texels of 1, 2 or 4 numbers (docs/api.md)."""
    await run_in_threadpool(ready_bake, services, bake)
    async with services.transfers.using(bake, services.bakes.store_path(bake)) as transfer:
        _, arrays = services.live.library.shader_arrays(_moving(transfer))
        make = partial(_array_of, arrays, array)
        return await services.answers.stream((bake, array), make, ArrayResponse.media_type, FOREVER)


def _moving(transfer: Opened) -> Opened:
    if transfer.eyes is not Eyes.FREE:
        raise NotFoundError("the views of this bake are fixed; bake the scene by method surface to move the eye")
    return transfer


def _array_of(arrays: Mapping[str, Callable[[], NDArray[Any]]], name: str) -> NDArray[Any]:
    if name not in arrays:
        raise NotFoundError(f"there is no array {name[:40]!r}; there are {', '.join(arrays)}")
    return arrays[name]()
