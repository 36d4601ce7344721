"""/api/models: BRDF models with parameters and curves, from which sliders are built; quantities computed from terms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from fastapi import APIRouter
from fastapi.concurrency import run_in_threadpool

from relume.brdf import registry
from relume.brdf.albedo import directional_albedo, reflectance
from relume.brdf.specular import specular_threshold
from relume.brdf.term_validation import complete_term
from relume_server.api.pagination import PageDep
from relume_server.schemas.models import AlbedoBody, ModelBody, TermsRequest, ZernikeFitBody, ZernikeFitRequest

router = APIRouter(prefix="/api/models", tags=["models"])


@router.get("")
def list_models(page: PageDep) -> list[ModelBody]:
    """List all BRDF models."""
    terms = page.in_order(registry.describe())
    return [ModelBody(**term, specular_below=specular_threshold(term["model"])) for term in terms]


@router.post("/zernike-fit")
async def get_zernike_fit(request: ZernikeFitRequest) -> list[ZernikeFitBody]:
    """Factorize the terms of a material for free cameras in the Zernike basis (Mahajan 2008)."""
    return await run_in_threadpool(_zernike_fit, _complete(request), request.basis_functions)


@router.post("/albedo")
async def get_albedo(request: TermsRequest) -> AlbedoBody:
    """Albedo of a material with these terms; physically at most 1."""
    return await run_in_threadpool(_albedo, _complete(request))


def _complete(request: TermsRequest) -> list[dict[str, Any]]:
    return [complete_term(("terms", index), term, None) for index, term in enumerate(request.terms)]


def _albedo(terms: list[dict[str, Any]]) -> AlbedoBody:
    theta, albedo = directional_albedo(terms)
    mean = np.sum([reflectance(term) for term in terms], axis=0)
    row = int(albedo.max(axis=1).argmax())
    return AlbedoBody(mean=mean.tolist(), max=float(albedo[row].max()), max_angle_degrees=math.degrees(theta[row]))


def _zernike_fit(terms: list[dict[str, Any]], basis_functions: int | None) -> list[ZernikeFitBody]:
    from relume.live.free_camera.factorization_error import factorization_errors  # imports compiled kernels

    return [ZernikeFitBody(**error._asdict()) for error in factorization_errors(terms, basis_functions)]
