"""/api/materials: the library of fitted materials, its navigation map, and thumbnails."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query
from fastapi.concurrency import run_in_threadpool

from relume.core.errors import NotFoundError
from relume.look.library import MapTable, navigation_map, presets
from relume_server.api.pagination import PageDep
from relume_server.io.png import A_DAY, PngResponse
from relume_server.schemas.bodies import MapPoint, MaterialBody, MaterialMapBody

router = APIRouter(prefix="/api/materials", tags=["materials"])
PathSegment = Annotated[str, Path(max_length=100)]


@router.get("")
def list_materials(page: PageDep) -> list[MaterialBody]:
    """List the library: fitted materials, each under every model fitted to it."""
    return [MaterialBody(**asdict(preset)) for preset in page.in_order(presets())]


@router.get("/map")
def get_material_map(table: MapTable = "ngan") -> MaterialMapBody:
    """Cook–Torrance materials of the library in the plane of reflectance and roughness, triangulated (Sun 2007).

    `table`: Ngan's fits, as in the paper, or Löw's.
    """
    nav_map = navigation_map(table)
    return MaterialMapBody(
        points=[
            MapPoint(id=preset.id, f0=f0, sigma=sigma)
            for preset, f0, sigma in zip(nav_map.presets, nav_map.f0.tolist(), nav_map.sigma.tolist(), strict=True)
        ],
        triangles=[(a, b, c) for a, b, c in nav_map.triangles.tolist()],
    )


@router.get("/map/at")
def material_at(
    f0: Annotated[float, Query(ge=0, le=1)],
    sigma: Annotated[float, Query(gt=0, le=10)],
    table: MapTable = "ngan",
) -> list[dict[str, Any]]:
    """Terms at any point of the map, interpolated between the surrounding materials."""
    return navigation_map(table).at(f0, sigma)


@router.get("/{table}/{material}/thumbnail.png", response_class=PngResponse, name="get_material_thumbnail")
async def thumbnail(table: PathSegment, material: PathSegment) -> PngResponse:
    """Ball of a library material."""
    png = await run_in_threadpool(_thumbnail, f"{table}/{material}")
    return PngResponse(png, headers=A_DAY)


def _thumbnail(identity: str) -> bytes:
    from relume.output.material_previews.library_sheet import library_preview_png  # imports compiled kernels

    png = library_preview_png(identity)
    if png is None:
        raise NotFoundError(f"the library has no material {identity[:80]!r}; GET /api/materials lists them")
    return png
