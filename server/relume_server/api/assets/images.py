"""/api/images: upload, list, show and delete images that replace a material's textures."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, File, Form, Response, UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.brdf.term_validation import complete_term
from relume.brdf.texture_slots import IMAGES, is_user_image
from relume.core.folder_size import folder_bytes
from relume.images.image_store import ImageRecord, get_record, records, thumbnail_path
from relume.images.metalness import with_metalness
from relume.scene.model import Material
from relume.scene.scene_folder import load_material
from relume_server.api.assets.in_use import remove_unused
from relume_server.api.assets.upload import store_upload
from relume_server.api.pagination import NameFilter, PageDep, records_page
from relume_server.auth.roles import Caller, CallerDep
from relume_server.io.png import FOREVER, PngResponse
from relume_server.io.upload_middleware import ReservationDep
from relume_server.schemas.base import Id
from relume_server.schemas.bodies import format_timestamp
from relume_server.schemas.images import ImageBody, MetalnessBody, MetalnessRequest
from relume_server.services import Services, ServicesDep
from relume_worker.paths import images_path, scene_path
from relume_worker.storage import fetch_if_missing

router = APIRouter(prefix="/api/images", tags=["images"])
ImageFile = Annotated[UploadFile, File(description="an image: .png, .jpg, .webp or .exr")]
ImageName = Annotated[str, Form(max_length=200)]


@router.post("", status_code=201)
async def import_image(
    image: ImageFile, services: ServicesDep, reservation: ReservationDep, response: Response, name: ImageName = ""
) -> ImageBody:
    """Store an image, which is read in a separate process; the body has its name for terms of looks."""
    identity = await store_upload(image, name, "image", reservation, services)
    response.headers["Location"] = f"/api/images/{identity}"
    return await run_in_threadpool(get_image, identity, services)


@router.get("")
def list_images(services: ServicesDep, page: PageDep, name: NameFilter = None) -> list[ImageBody]:
    """List images, newest first, filtered by name."""
    return [_body(record) for record in records_page(records(images_path(services.settings.data)), name, page)]


@router.get("/{image}")
def get_image(image: Id, services: ServicesDep) -> ImageBody:
    """Return one image."""
    return _body(get_record(images_path(services.settings.data), image))


@router.post("/{image}/metalness", status_code=201)
async def put_metalness(
    image: Id, request: MetalnessRequest, services: ServicesDep, caller: CallerDep
) -> MetalnessBody:
    """Make two images from a metallic map and the base color, and return the material's terms that use them."""
    data, folder = services.settings.data, images_path(services.settings.data)
    terms = [complete_term(("terms", k), term, None) for k, term in enumerate(request.terms)]

    def read(scene: str, material: str) -> Material:
        return load_material(fetch_if_missing(scene_path(data, scene)), material)

    args = folder, terms, image, request.scene, request.material, read
    async with services.import_queue.reserving(caller.name, 0) as reservation:
        compute_terms = partial(with_metalness, *args, reservation.reserve)
        metallic_terms = await services.import_queue.run_in_slot(caller.name, compute_terms)
        for name in sorted({texture for term in metallic_terms if is_user_image(texture := term["texture"])}):
            await run_in_threadpool(_assign_owner, services, caller, folder, name.removeprefix(IMAGES.prefix))
    return MetalnessBody(terms=metallic_terms)


def _assign_owner(services: Services, caller: Caller, folder: Path, identity: str) -> None:
    """Count a derived image for its caller."""
    if get_record(folder, identity).recipe is not None:
        services.access.quotas.assign_owner(caller.name, "image", identity, folder_bytes(folder / identity))


@router.get("/{image}/thumbnail.png", response_class=PngResponse)
def get_image_thumbnail(image: Id, services: ServicesDep) -> PngResponse:
    """Thumbnail, 96 × 96."""
    return PngResponse(thumbnail_path(images_path(services.settings.data), image).read_bytes(), headers=FOREVER)


@router.delete("/{image}", status_code=204)
async def delete_image(image: Id, services: ServicesDep) -> Response:
    """Delete an image and the images derived from it, if no saved look, share link, session or job uses them."""
    folder = images_path(services.settings.data)
    record = await run_in_threadpool(get_record, folder, image)
    derived_ids = [
        candidate.id
        for candidate in await run_in_threadpool(records, folder)
        if candidate.recipe and record.texture in candidate.recipe.images
    ]
    for identity in (*derived_ids, image):
        await remove_unused(IMAGES, folder, identity, "image", services, called=f"image {record.name!r}")
    return Response(status_code=204)


def _body(record: ImageRecord) -> ImageBody:
    return ImageBody(
        id=record.id,
        texture=record.texture,
        name=record.name,
        created=format_timestamp(record.created),
        size=record.size,
        warnings=list(record.warnings),
        roughness=record.roughness,
        metalness=record.recipe.metalness if record.recipe else None,
        base=record.recipe.base if record.recipe else None,
        thumbnail=f"/api/images/{record.id}/thumbnail.png",
    )
