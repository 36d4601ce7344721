"""/api/models/principled: materials as principled parameters, and the terms of these."""

from __future__ import annotations

from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any

from fastapi import APIRouter
from fastapi.concurrency import run_in_threadpool

from relume.brdf.term_validation import complete_term
from relume.export.principled_material import (
    NO_TEXTURES,
    TextureMeans,
    complete_parameters,
    principled_terms,
    read_principled,
    texture_means,
)
from relume.look.glass import complete_glass, default_glass
from relume.scene.model import Glass
from relume.scene.scene_folder import load_material
from relume_server.schemas.models import (
    PrincipledBody,
    PrincipledParameters,
    PrincipledRequest,
    PrincipledTermsBody,
    PrincipledTermsRequest,
    TermsRequest,
    TextureMeansBody,
)
from relume_server.services import Services, ServicesDep
from relume_worker.paths import scene_path
from relume_worker.scenes import get_scene
from relume_worker.storage import fetch_if_missing

router = APIRouter(prefix="/api/models/principled", tags=["models"])


@router.post("", name="read_principled")
async def read(request: PrincipledRequest, services: ServicesDep) -> PrincipledBody:
    """Principled parameters of a material, or those of the closest principled material."""
    return await run_in_threadpool(_read, request, services)


@router.post("/terms", name="principled_terms")
async def make_terms(request: PrincipledTermsRequest) -> PrincipledTermsBody:
    """Terms of principled parameters, as an import makes them."""
    return await run_in_threadpool(_make_terms, request)


def _read(request: PrincipledRequest, services: Services) -> PrincipledBody:
    terms = _complete(request)
    means = _texture_means(request, terms, services)
    reading = read_principled(terms, _glass(request), means)
    return PrincipledBody(
        parameters=PrincipledParameters(**asdict(reading.parameters)),
        terms=reading.terms,
        glass=reading.glass,
        error=reading.error,
        reason=reading.reason,
        texture_means=TextureMeansBody(diffuse=means[0], specular=means[1]),
    )


def _make_terms(request: PrincipledTermsRequest) -> PrincipledTermsBody:
    parameters = complete_parameters(("parameters",), request.parameters)
    given = request.texture_means
    means = NO_TEXTURES if given is None else (given.diffuse, given.specular)
    terms, glass = principled_terms(parameters, _complete(request), _glass(request), means)
    return PrincipledTermsBody(terms=terms, glass=glass)


def _complete(request: TermsRequest) -> list[dict[str, Any]]:
    return [complete_term(("terms", index), term, None) for index, term in enumerate(request.terms)]


def _glass(request: PrincipledRequest | PrincipledTermsRequest) -> dict[str, Any] | None:
    given = request.glass
    if given is None:
        return None
    return complete_glass(("glass",), given, default_glass(Glass(thickness=float("absorption" in given))))


def _texture_means(request: PrincipledRequest, terms: list[dict[str, Any]], services: Services) -> TextureMeans:
    if request.scene is None or request.material is None:
        return NO_TEXTURES
    get_scene(services.bakes.ledger, request.scene)
    textures = tuple((term["model"], term["texture"]) for term in terms)
    return _cached_means(scene_path(services.settings.data, request.scene), request.material, textures)


@lru_cache(maxsize=256)  # a few numbers each, of large textures
def _cached_means(folder: Path, material: str, textures: tuple[tuple[str, str | None], ...]) -> TextureMeans:
    terms = [{"model": model, "texture": texture} for model, texture in textures]
    return texture_means(load_material(fetch_if_missing(folder), material), terms)
