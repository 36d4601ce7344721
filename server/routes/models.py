"""GET /api/models: every BRDF term, its parameters and curves; sliders are built from it."""

from __future__ import annotations

from fastapi import APIRouter

from relume.brdf import registry
from server.wire.bodies import ModelBody

router = APIRouter(prefix="/api", tags=["models"])


@router.get("/models")
def list_models() -> list[ModelBody]:
    """Every BRDF term."""
    return [ModelBody(**term) for term in registry.describe()]
