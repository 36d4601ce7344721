"""Quality presets of bakes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from relume.core.errors import PlanError
from relume.store.bake_protocol import Recipe
from relume_worker.status import FREE_CAMERA_METHODS

_STEP = 16  # pixels: widths are multiples of it
PresetName = Literal["preview", "good", "final"]


@dataclass(frozen=True)
class Preset:
    """Width and height in pixels, and number of environment triangles."""

    size: tuple[int, int]
    num_lights: int

    def fit_aspect(self, aspect: float) -> tuple[int, int]:
        """Width and height with about as many pixels. aspect: width ÷ height."""
        width = max(_STEP, _STEP * round(math.sqrt(math.prod(self.size) * aspect) / _STEP))
        return width, max(_STEP, round(width / aspect))


PRESETS: dict[PresetName, Preset] = {
    "preview": Preset((320, 240), 300),
    "good": Preset((640, 480), 2000),
    "final": Preset((1024, 768), 4000),
}


def resolve_num_probes(method: str, requested: int | None) -> int:
    """Return `num_probes` for a recipe; the default if no number is requested.

    Raises:
        PlanError: a number is requested, and the method has no free camera.
    """
    if requested is not None and method not in FREE_CAMERA_METHODS:
        raise PlanError(f"method {method} has no probes; leave out the {requested} probes")
    return requested or Recipe.num_probes
