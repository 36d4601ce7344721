"""/api/example-scenes: list and import built-in scenes."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Response
from fastapi.concurrency import run_in_threadpool

from relume.core.errors import NotFoundError
from relume.scene.examples.catalog import BUILT_IN
from relume_server.api.pagination import PageDep
from relume_server.api.scenes import get_scene_body
from relume_server.auth.roles import CallerDep
from relume_server.io.import_request import ImportRequest
from relume_server.schemas.bodies import ExampleSceneBody, SceneBody
from relume_server.services import ServicesDep

router = APIRouter(prefix="/api/example-scenes", tags=["scenes"])
ExampleName = Annotated[str, Path(max_length=256)]


@router.get("", name="list_example_scenes")
def list_examples(page: PageDep) -> list[ExampleSceneBody]:
    """List all built-in scenes, in display order."""
    return [
        ExampleSceneBody(name=name, label=each.label, description=each.description, size=each.size, method=each.method)
        for name, each in page.in_order(BUILT_IN.items())
    ]


@router.post("/{name}", status_code=201, name="import_example_scene")
async def import_example(name: ExampleName, services: ServicesDep, caller: CallerDep, response: Response) -> SceneBody:
    """Import a built-in scene; repeating the call returns the same scene."""
    if name not in BUILT_IN:
        raise NotFoundError(f"there is no built-in scene {name[:80]!r}; choose from {', '.join(BUILT_IN)}")
    request = ImportRequest.create(services.settings, "built_in", None, name)
    async with services.import_queue.reserving(caller.name, 0) as reservation:
        identity = await services.import_queue.import_file(reservation, lambda folder: request)
    response.headers["Location"] = f"/api/scenes/{identity}"
    return await run_in_threadpool(get_scene_body, identity, services)
