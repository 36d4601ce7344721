"""How fine a bake is, by name or by number."""

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
    """Width and height in pixels, and triangles of light."""

    size: tuple[int, int]
    num_lights: int

    def fit_aspect(self, aspect: float) -> tuple[int, int]:
        """Width and height of about as many pixels. aspect: width ÷ height."""
        width = max(_STEP, _STEP * round(math.sqrt(math.prod(self.size) * aspect) / _STEP))
        return width, max(_STEP, round(width / aspect))


PRESETS: dict[PresetName, Preset] = {
    "preview": Preset((320, 240), 300),
    "good": Preset((640, 480), 2000),
    "final": Preset((1024, 768), 4000),
}


def resolve_num_probes(method: str, requested: int | None) -> int:
    """The `num_probes` of a recipe; as many as usual where no number is asked for.

    Raises:
        PlanError: a number is asked for, and the method has no free camera.
    """
    if requested is not None and method not in FREE_CAMERA_METHODS:
        raise PlanError(f"{requested} probes were asked for; method {method} has none, leave them out")
    return requested or Recipe.num_probes
