"""/api/images: send, list, show and delete images that looks may name in place of a material's own."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Response, UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.brdf.channels import IMAGES, is_image
from relume.brdf.document import complete_term
from relume.folders import folder_bytes
from relume.images.metals import with_metalness
from relume.images.shelf import ImageRecord, get_record, records, thumbnail_path
from relume.scene.archive import load_material
from relume.scene.model import Material
from server.access.roles import Caller, Who
from server.files.door import Held
from server.files.png import FOREVER, PngResponse
from server.routes.paging import NameFilter, Paged, records_page
from server.routes.shelves.in_use import remove_unused
from server.routes.shelves.sending import take_in
from server.services import Services, Shared
from server.wire.bodies import moment
from server.wire.body import Id
from server.wire.images import ImageBody, MetalnessBody, MetalnessRequest
from worker.paths import images_path, scene_path
from worker.storage import fetched

router = APIRouter(prefix="/api/images", tags=["images"])
ImageFile = Annotated[UploadFile, File(description="an image: .png, .jpg, .webp or .exr")]
ImageName = Annotated[str, Form(max_length=200)]


@router.post("", status_code=201)
async def send_image(
    image: ImageFile, services: Shared, held: Held, response: Response, name: ImageName = ""
) -> ImageBody:
    """Keep an image, read in a process of its own; the body says how terms of looks name it."""
    identity = await take_in(image, name, "image", held, services)
    response.headers["Location"] = f"/api/images/{identity}"
    return await run_in_threadpool(get_image, identity, services)


@router.get("")
def list_images(services: Shared, page: Paged, name: NameFilter = None) -> list[ImageBody]:
    """Images, newest first, or those of a name."""
    return [_body(record) for record in records_page(records(images_path(services.settings.data)), name, page)]


@router.get("/{image}")
def get_image(image: Id, services: Shared) -> ImageBody:
    """One image."""
    return _body(get_record(images_path(services.settings.data), image))


@router.post("/{image}/metalness", status_code=201)
async def put_metalness(image: Id, request: MetalnessRequest, services: Shared, caller: Who) -> MetalnessBody:
    """Let an image say where a material is metal: two images are made of it and of the base colour, and the body says
    what the material's terms become with them."""
    data, folder = services.settings.data, images_path(services.settings.data)
    await run_in_threadpool(services.access.quotas.check_bytes, caller.name, 0)
    terms = [complete_term(("terms", k), term, None) for k, term in enumerate(request.terms)]

    def read(scene: str, material: str) -> Material:
        return load_material(fetched(scene_path(data, scene)), material)

    make = partial(with_metalness, folder, terms, image, request.scene, request.material, read)
    made = await services.intake.work(caller.name, make)
    for name in sorted({texture for term in made if is_image(texture := term["texture"])}):
        await run_in_threadpool(_own, services, caller, folder, name.removeprefix(IMAGES.prefix))
    return MetalnessBody(terms=made)


def _own(services: Services, caller: Caller, folder: Path, identity: str) -> None:
    """What was made for somebody is theirs, and counts."""
    if get_record(folder, identity).made_of is not None:
        services.access.quotas.own(caller.name, "image", identity, folder_bytes(folder / identity))


@router.get("/{image}/thumbnail.png", response_class=PngResponse)
def get_image_thumbnail(image: Id, services: Shared) -> PngResponse:
    """A small picture of it, 96 × 96."""
    return PngResponse(thumbnail_path(images_path(services.settings.data), image).read_bytes(), headers=FOREVER)


@router.delete("/{image}", status_code=204)
async def delete_image(image: Id, services: Shared) -> Response:
    """Delete an image that no saved look, link, session of this server or work under way names, nor any that was made
    of it; these go with it."""
    folder = images_path(services.settings.data)
    record = await run_in_threadpool(get_record, folder, image)
    made = [
        one.id
        for one in await run_in_threadpool(records, folder)
        if one.made_of and record.texture in one.made_of.images
    ]
    for identity in (*made, image):
        await remove_unused(IMAGES, folder, identity, "image", services, called=f"image {record.name!r}")
    return Response(status_code=204)


def _body(record: ImageRecord) -> ImageBody:
    return ImageBody(
        id=record.id,
        texture=record.texture,
        name=record.name,
        created=moment(record.created),
        size=record.size,
        warnings=list(record.warnings),
        roughness=record.roughness,
        metalness=record.made_of.metalness if record.made_of else None,
        base=record.made_of.base if record.made_of else None,
        thumbnail=f"/api/images/{record.id}/thumbnail.png",
    )
