"""/api/scenes: import, list, show and delete scenes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Query, Response, UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.core.errors import Description, NotFoundError, ParameterError
from relume.core.folder_size import folder_bytes
from relume.scene_io.import_options import ImportOptions, LightUnit, Recenter, Unit, UpAxis
from relume_server.api.pagination import PageDep, newest
from relume_server.auth.roles import CallerDep
from relume_server.batch.bake_previews import MAX_WIDTH
from relume_server.io.downloads import Download
from relume_server.io.import_request import ImportRequest
from relume_server.io.upload_middleware import ReservationDep
from relume_server.io.uploads import plain_stem, save_upload
from relume_server.openapi import files
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import (
    SceneBody,
    SceneMaterial,
    SceneVariant,
    SceneView,
    SceneWarning,
    format_timestamp,
)
from relume_server.services import ServicesDep
from relume_worker.cameras import camera_names_by_scene, list_cameras
from relume_worker.paths import scene_path
from relume_worker.scenes import SceneRecord, delete_scene, get_scene, list_scenes
from relume_worker.status import BakeStatus
from relume_worker.storage import fetch_if_missing

router = APIRouter(prefix="/api/scenes", tags=["scenes"])
_MATERIAL_DEFAULTS = {
    "shadow_catcher": False,
    "is_projected": False,
    "is_glass": False,
    "is_textured": True,
    "objects": (),
}  # for records without these fields
DEFAULT_ASPECT = 4 / 3  # of cameras with a vertical field of view only
SceneFile = Annotated[
    UploadFile,
    File(description="a .glb, .gltf, .obj, .ply, .stl or .usd file, or a .zip with one and the files it references"),
]
EnvironmentFile = Annotated[UploadFile | None, File(description="equirectangular environment map, .hdr or .exr")]
SceneName = Annotated[str, Form(max_length=200)]
Ground = Annotated[bool, Form(description="whether to add a ground plane that catches shadows")]
Up = Annotated[UpAxis, Form(description="axis of the file that points up")]
FileUnit = Annotated[Unit, Form(description="unit of the file; auto guesses it from the size of the scene")]
Recentered = Annotated[Recenter, Form(description="whether positions become relative to the middle of the scene")]
FileLightUnit = Annotated[LightUnit, Form(description="unit of the file's point, spot and directional lights")]
FileScene = Annotated[str, Form(max_length=200, description="name or number of a scene, of a glTF file with several")]
FileTime = Annotated[
    float | None, Form(allow_inf_nan=False, description="moment of the animation: seconds in glTF, time code in USD")
]
Companions = Annotated[
    list[UploadFile],
    File(description="files that the scene references; file names include the folders"),
]
MAX_COMPANIONS, MAX_PATH = 900, 1_024


@router.post("", status_code=201)
async def import_scene(
    scene: SceneFile,
    services: ServicesDep,
    reservation: ReservationDep,
    response: Response,
    environment: EnvironmentFile = None,
    name: SceneName = "",
    companions: Companions = [],  # noqa: B006  (never changed)
    ground: Ground = False,
    up: Up = "file",
    unit: FileUnit = "file",
    recenter: Recentered = "auto",
    light_unit: FileLightUnit = "file",
    scene_name: FileScene = "",
    time: FileTime = None,
) -> SceneBody:
    """Import a scene in a separate process; the body has a summary, and a warning for each unsupported feature."""
    if not name.isprintable():
        raise ParameterError("name", name, "printable characters")
    if len(companions) > MAX_COMPANIONS or any(len(each.filename or "") > MAX_PATH for each in companions):
        allowed = f"at most {MAX_COMPANIONS} files with names of at most {MAX_PATH:,} characters"
        raise ParameterError("companions", Description(f"a list of {len(companions)} files"), allowed)
    called = name.strip() or plain_stem(scene.filename) or "Scene"

    def make_request(folder: Path) -> ImportRequest:
        file = save_upload(scene, folder / "scene")
        environment_path = None if environment is None else save_upload(environment, folder / "environment")
        companion_paths = {
            each.filename or "": save_upload(each, folder / f"companion-{number}")
            for number, each in enumerate(companions)
        }
        request = ImportRequest.create(
            services.settings, "scene", file, called, environment_path, scene.filename or "", companion_paths
        )
        options = ImportOptions(
            up=up, unit=unit, recenter=recenter, light_unit=light_unit, scene_name=scene_name, time=time
        )
        return replace(request, ground=ground, options=options.document())

    identity = await services.import_queue.import_file(reservation, make_request)
    response.headers["Location"] = f"/api/scenes/{identity}"
    return await run_in_threadpool(get_scene_body, identity, services)


@router.post("/{scene}/ground", status_code=201)
async def add_ground(scene: Id, services: ServicesDep, caller: CallerDep, response: Response) -> SceneBody:
    """Add a ground plane that catches shadows, as a new scene; the original is unchanged."""
    record = await run_in_threadpool(get_scene, services.bakes.ledger, scene)
    folder = await run_in_threadpool(fetch_if_missing, scene_path(services.settings.data, scene))
    request = ImportRequest.create(services.settings, "grounded", folder, f"{record.name[:185]} on a ground")
    async with services.import_queue.reserving(
        caller.name, await run_in_threadpool(folder_bytes, folder)
    ) as reservation:
        identity = await services.import_queue.import_file(reservation, lambda _: request)
    response.headers["Location"] = f"/api/scenes/{identity}"
    return await run_in_threadpool(get_scene_body, identity, services)


@router.get("", name="list_scenes")
def list_scene_bodies(
    services: ServicesDep, page: PageDep, name: Annotated[str | None, Query(max_length=200)] = None
) -> list[SceneBody]:
    """List scenes, newest first, filtered by name."""
    records = [record for record in list_scenes(services.bakes.ledger) if name in (None, record.name)]
    records = page.cut(records, lambda record: newest(record.created, record.id))
    bakes: dict[str, list[BakeStatus]] = defaultdict(list)
    for status in services.bakes.bakes():
        bakes[status.scene].append(status)
    placed = camera_names_by_scene(services.bakes.ledger)
    return [_body(record, bakes[record.id], placed[record.id]) for record in records]


@router.get("/{scene}", name="get_scene")
def get_scene_body(scene: Id, services: ServicesDep) -> SceneBody:
    """Return one scene."""
    placed = [camera.name for camera in list_cameras(services.bakes.ledger, scene)]
    return _body(get_scene(services.bakes.ledger, scene), services.bakes.bakes(scene), placed)


@router.delete("/{scene}", status_code=204, name="delete_scene")
def remove_scene(scene: Id, services: ServicesDep) -> Response:
    """Delete a scene and its bakes."""
    bakes = [status.id for status in services.bakes.bakes(scene)]
    delete_scene(services.settings.data, services.bakes.ledger, scene)
    services.comments.delete_scene(scene)
    services.access.quotas.disown("scene", scene)
    services.access.quotas.disown("bake", *bakes)
    return Response(status_code=204)


@router.get(
    "/{scene}/thumbnail.webp",
    response_class=Download,
    name="get_scene_thumbnail",
    responses=files("image/webp"),
)
async def get_thumbnail(scene: Id, services: ServicesDep, bake: Id | None = None) -> Download:
    """Thumbnail of the unedited scene from a bake; `bake` only makes the URL change with the image."""
    statuses = await run_in_threadpool(services.bakes.bakes, scene)
    shown_bake = _thumbnail_bake([status for status in statuses if bake in (None, status.id)])
    if shown_bake is None:
        raise NotFoundError("there is no thumbnail of this scene; bake it first")
    path = await services.thumbnails.get_or_paint(shown_bake)
    return Download(path, media_type="image/webp", headers={"Cache-Control": "private, max-age=86400"})


def _thumbnail_bake(bakes: Sequence[BakeStatus]) -> str | None:
    """Choose the bake for a thumbnail: the coarsest with enough pixels renders fastest; otherwise the finest."""
    ready_bakes = sorted((status for status in bakes if status.state == "ready"), key=lambda status: status.rank)
    large_bakes = [status for status in ready_bakes if status.recipe.size[0] >= MAX_WIDTH]
    return (large_bakes or ready_bakes[-1:])[0].id if ready_bakes else None


def _body(record: SceneRecord, bakes: Sequence[BakeStatus], placed: Sequence[str]) -> SceneBody:
    bake = _thumbnail_bake(bakes)
    return SceneBody(
        id=record.id,
        name=record.name,
        created=format_timestamp(record.created),
        views=[
            SceneView(name=name, aspect=aspect or DEFAULT_ASPECT, is_placed=is_placed)
            for names, aspects, is_placed in ((record.views, record.aspects, False), (placed, (), True))
            for name, aspect in zip_longest(names, aspects)
        ],
        materials=[SceneMaterial(**{**_MATERIAL_DEFAULTS, **material}) for material in record.materials],
        lights=list(record.lights),
        objects=list(record.objects),
        variants=[SceneVariant(name=name, look=look) for name, look in record.variants.items()],
        warnings=[SceneWarning.model_validate(warning.document()) for warning in record.warnings],
        import_options=ImportOptions.model_validate(record.import_options),
        size=record.size,
        triangles=record.num_triangles,
        thumbnail=f"/api/scenes/{record.id}/thumbnail.webp?bake={bake}" if bake else None,
        bakes=[status.id for status in bakes],
    )
