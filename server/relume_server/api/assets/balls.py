"""/api/scenes/{scene}/ball: preview of a scene's material on a ball, like those of the library."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from anyio import CapacityLimiter, to_thread
from fastapi import APIRouter

from relume.brdf.term_validation import complete_term
from relume.brdf.texture_slots import is_user_image
from relume.scene.model import Texture
from relume.scene.scene_folder import load_material
from relume_server.io.png import PngResponse
from relume_server.schemas.base import Id
from relume_server.schemas.models import BallRequest
from relume_server.services import ServicesDep
from relume_worker.paths import scene_path
from relume_worker.scenes import get_scene
from relume_worker.storage import fetch_if_missing

router = APIRouter(prefix="/api/scenes", tags=["scenes"])
MAX_STORED = 500  # balls of about 6 kB each
_RENDER_LIMITER = CapacityLimiter(1)  # half a second each: sessions have priority


@router.post("/{scene}/ball", response_class=PngResponse)
async def render_ball(scene: Id, request: BallRequest, services: ServicesDep) -> PngResponse:
    """Ball of a material with these terms and their images. PNG, 64 × 64."""
    terms = [complete_term(("terms", index), term, None) for index, term in enumerate(request.terms)]
    await to_thread.run_sync(get_scene, services.bakes.ledger, scene)
    folder = scene_path(services.settings.data, scene)
    png = await to_thread.run_sync(_stored, folder, request.material, json.dumps(terms), limiter=_RENDER_LIMITER)
    return PngResponse(png)


@lru_cache(maxsize=MAX_STORED)
def _stored(folder: Path, material: str, terms: str) -> bytes:
    from relume.output.material_previews.preview import preview_png  # imports compiled kernels

    documents = json.loads(terms)
    return preview_png(documents, _images(folder, material, documents))


def _images(folder: Path, material: str, documents: Sequence[dict[str, Any]]) -> dict[str, Texture]:
    """Images that terms use: uploaded ones, and the scene's textures."""
    from relume.images.image_store import load_texture

    named = {document["texture"] for document in documents} - {None}
    images = {name: load_texture(name) for name in named if is_user_image(name)}
    if any(not is_user_image(name) for name in named):
        images |= load_material(fetch_if_missing(folder), material).textures
    return images
