"""/api/bakes/{bake}/light-mix: a look with the lights of a light mix."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.concurrency import run_in_threadpool

from relume import look as looks
from relume.core.errors import Description, ParameterError
from relume.live.fixed_camera.protocols import OpenBake
from relume.look.light_mix import FORMAT, expand_light_mix
from relume_server.api.bakes import require_ready_bake
from relume_server.schemas.base import Id
from relume_server.schemas.looks import MixedLookBody, MixRequest
from relume_server.services import ServicesDep

router = APIRouter(prefix="/api/bakes/{bake}/light-mix", tags=["looks"])


@router.post("", name="mix_look")
async def mix_look(bake: Id, request: MixRequest, services: ServicesDep) -> MixedLookBody:
    """Return a look with brightness and color of lights as in a light mix, for clients that change their look."""
    await run_in_threadpool(require_ready_bake, services, bake)
    async with services.transfers.acquire(bake, services.bakes.store_path(bake)) as transfer:
        return await run_in_threadpool(_mix, request, transfer)


def _mix(request: MixRequest, transfer: OpenBake) -> MixedLookBody:
    if request.mix.get("format") != FORMAT:
        raise ParameterError("/mix/format", Description("not a light mix"), repr(FORMAT))
    look = looks.complete(request.look, transfer.default_look)
    partial, warnings = expand_light_mix(request.mix, look)
    return MixedLookBody(look=looks.complete(partial, look), warnings=warnings)
