"""An IES file and a gobo made by code, with the same light as textures of Mitsuba's spot.

Mitsuba has no IES files: its spot projects an image of the analytic web, (1 + cos(C) / 2) cos² θ / 1.5.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from relume.assets.ies.ies_store import IES_FILES, store_ies
from relume.brdf.texture_slots import IMAGES
from relume.image_io.write_image import write_image
from relume.images.image_store import store

_POLAR, _AZIMUTH = np.linspace(0, 90, 91), np.linspace(0, 360, 73)
_FIELDS, _FIELD_PIXELS = 6, 64
_COLORS = np.array([[255, 180, 60], [0, 60, 180]], np.uint8)
_TEXTURE_SIDE = 1024


@contextmanager
def light_assets(folder: Path) -> Iterator[dict[str, str]]:
    """Store the web and the gobo for looks, and their textures; yield their names in looks. folder: for all files"""
    with ExitStack() as stack:
        webs = stack.enter_context(IES_FILES.with_search_folder(folder / "webs"))
        images = stack.enter_context(IMAGES.with_search_folder(folder / "images"))
        ies, gobo = folder / "ies.ies", folder / "gobo.png"
        ies.write_text(_ies_text())
        field = np.indices((_FIELDS, _FIELDS)).sum(axis=0) % 2
        Image.fromarray(_COLORS[field].repeat(_FIELD_PIXELS, axis=0).repeat(_FIELD_PIXELS, axis=1)).save(gobo)
        yield {"ies": store_ies(webs, ies, "Web").reference, "gobo": store(images, gobo, "Gobo").texture}


def mitsuba_texture(folder: Path, light: dict[str, Any]) -> dict[str, Any]:
    """Texture of Mitsuba's spot, over the square about its cone; empty for a light without an IES file and a gobo.

    Args:
        folder: as for `light_assets`. light: a light of a look.
    """
    if "gobo" in light:
        bitmap = {"filename": str(folder / "gobo.png"), "raw": False}
    elif "profile" in light:
        write_image(folder / "web.exr", np.repeat(_web_image(light["cone"][1])[..., None], 3, axis=2))
        bitmap = {"filename": str(folder / "web.exr"), "raw": True}
    else:
        return {}
    return {"texture": {"type": "bitmap", "wrap_mode": "clamp", **bitmap}}


def _web(cos_theta: Any, cos_azimuth: Any) -> Any:
    """Relative intensity."""
    return (1 + cos_azimuth / 2) * cos_theta**2 / 1.5


def _ies_text() -> str:
    candela = 1000 * _web(np.cos(np.radians(_POLAR)), np.cos(np.radians(_AZIMUTH))[:, None])
    rows = [" ".join(f"{value:.7g}" for value in row) for row in (_POLAR, _AZIMUTH, *candela)]
    counts = f"1 1000 1 {len(_POLAR)} {len(_AZIMUTH)} 1 2 0 0 0\n1 1 50"
    return "\n".join(["IESNA:LM-63-2002", "TILT=NONE", counts, *rows])


def _web_image(outer: float) -> Any:
    """The web over the square about a cone; its columns run against the horizontal axis of the light. (side, side)"""
    u, v = np.meshgrid(*[(np.arange(_TEXTURE_SIDE) + 0.5) / _TEXTURE_SIDE] * 2)
    x, y = (np.tan(np.radians(outer)) * (1 - 2 * side) for side in (u, v))
    radius = np.hypot(x, y)
    return _web(1 / np.sqrt(1 + radius**2), x / radius).astype(np.float32)
