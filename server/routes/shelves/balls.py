"""/api/scenes/{scene}/ball: what a material of a scene looks like, on a ball as the library's are."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from anyio import CapacityLimiter, to_thread
from fastapi import APIRouter

from relume.brdf.channels import is_user_image
from relume.brdf.document import complete_term
from relume.scene.archive import load_material
from relume.scene.model import Texture
from server.files.png import PngResponse
from server.services import ServicesDep
from server.wire.body import Id
from server.wire.models import BallRequest
from worker.paths import scene_path
from worker.scenes import get_scene
from worker.storage import fetch_if_missing

router = APIRouter(prefix="/api/scenes", tags=["scenes"])
MAX_STORED = 500  # balls, of about 6 kB each
_RENDER_LIMITER = CapacityLimiter(1)  # of half a second each: sessions go first


@router.post("/{scene}/ball", response_class=PngResponse)
async def render_ball(scene: Id, request: BallRequest, services: ServicesDep) -> PngResponse:
    """A ball of a material with these terms, in the images that they name. PNG, 64 × 64."""
    terms = [complete_term(("terms", index), term, None) for index, term in enumerate(request.terms)]
    await to_thread.run_sync(get_scene, services.bakes.ledger, scene)
    folder = scene_path(services.settings.data, scene)
    png = await to_thread.run_sync(_stored, folder, request.material, json.dumps(terms), limiter=_RENDER_LIMITER)
    return PngResponse(png)


@lru_cache(maxsize=MAX_STORED)
def _stored(folder: Path, material: str, terms: str) -> bytes:
    from relume.balls.ball import preview_png  # loads compiled kernels

    documents = json.loads(terms)
    return preview_png(documents, _images(folder, material, documents))


def _images(folder: Path, material: str, documents: Sequence[dict[str, Any]]) -> dict[str, Texture]:
    """The images that terms name: those that were sent, and the scene's own."""
    from relume.images.shelf import load_texture

    named = {document["texture"] for document in documents} - {None}
    images = {name: load_texture(name) for name in named if is_user_image(name)}
    if any(not is_user_image(name) for name in named):
        images |= load_material(fetch_if_missing(folder), material).textures
    return images
