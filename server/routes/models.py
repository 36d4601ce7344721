"""GET /api/models: every BRDF term, its parameters and curves; sliders are built from it."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from relume.brdf import registry

router = APIRouter(prefix="/api", tags=["models"])


@router.get("/models")
def list_models() -> list[dict[str, Any]]:
    """Every BRDF term."""
    return registry.describe()
