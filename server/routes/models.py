"""GET /api/models and /api/materials: every BRDF term, and the library of materials made of them."""

from __future__ import annotations

from dataclasses import asdict

from fastapi import APIRouter

from relume.brdf import registry
from relume.look.library import navigation_map, presets
from server.bodies import MapPoint, MaterialBody, MaterialMapBody, ModelBody

router = APIRouter(prefix="/api", tags=["models"])


@router.get("/models")
def list_models() -> list[ModelBody]:
    """Every BRDF term."""
    return [ModelBody(**term) for term in registry.describe()]


@router.get("/materials")
def list_materials() -> list[MaterialBody]:
    """The library: fitted materials under every model that was fitted to them."""
    return [MaterialBody(**asdict(preset)) for preset in presets()]


@router.get("/materials/map")
def show_material_map() -> MaterialMapBody:
    """The library's Cook–Torrance materials in the plane of reflectance and roughness, triangulated (Sun 2007)."""
    found = navigation_map()
    return MaterialMapBody(
        points=[
            MapPoint(id=preset.id, f0=f0, sigma=sigma)
            for preset, f0, sigma in zip(found.presets, found.f0.tolist(), found.sigma.tolist(), strict=True)
        ],
        triangles=[(a, b, c) for a, b, c in found.triangles.tolist()],
    )
