"""/api/images: send, list, show and delete images that looks may name in place of a material's own."""

from __future__ import annotations

from functools import partial
from typing import Annotated

from fastapi import APIRouter, File, Form, Response, UploadFile
from fastapi.concurrency import run_in_threadpool

from relume.brdf.channels import IMAGES
from relume.images.shelf import ImageRecord, get_record, records, thumbnail_path
from server.access.roles import Who
from server.files.png import FOREVER, PngResponse
from server.routes.shelves.in_use import remove_unused
from server.routes.shelves.sending import import_apart, take_in
from server.services import Shared
from server.wire.bodies import ImageBody, moment
from server.wire.body import Id
from worker.paths import images_path

router = APIRouter(prefix="/api/images", tags=["images"])
ImageFile = Annotated[UploadFile, File(description="an image: .png, .jpg, .webp or .exr")]
ImageName = Annotated[str, Form(max_length=200)]


@router.post("", status_code=201)
async def send_image(
    image: ImageFile, services: Shared, caller: Who, response: Response, name: ImageName = ""
) -> ImageBody:
    """Keep an image, read in a process of its own; the body says how terms of looks name it."""
    shelf, read = images_path(services.settings.data), partial(import_apart, image, name, "image", services)
    identity = await take_in(image, caller, services, "image", shelf, read)
    response.headers["Location"] = f"/api/images/{identity}"
    return await run_in_threadpool(get_image, identity, services)


@router.get("")
def list_images(services: Shared) -> list[ImageBody]:
    """All of them, newest first."""
    return [_body(record) for record in records(images_path(services.settings.data))]


@router.get("/{image}")
def get_image(image: Id, services: Shared) -> ImageBody:
    """One image."""
    return _body(get_record(images_path(services.settings.data), image))


@router.get("/{image}/thumbnail.png", response_class=PngResponse)
def get_image_thumbnail(image: Id, services: Shared) -> PngResponse:
    """A small picture of it, 96 × 96."""
    return PngResponse(thumbnail_path(images_path(services.settings.data), image).read_bytes(), headers=FOREVER)


@router.delete("/{image}", status_code=204)
async def delete_image(image: Id, services: Shared) -> Response:
    """Delete an image that no saved look, link, session of this server or work under way names."""
    folder = images_path(services.settings.data)
    record = await run_in_threadpool(get_record, folder, image)
    await remove_unused(IMAGES, folder, image, "image", services, called=f"image {record.name!r}")
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
        thumbnail=f"/api/images/{record.id}/thumbnail.png",
    )
