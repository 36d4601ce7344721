"""How fine a bake is, by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

PresetName = Literal["preview", "good", "final"]


@dataclass(frozen=True)
class Preset:
    """Width and height in pixels, and triangles of light."""

    size: tuple[int, int]
    num_lights: int


PRESETS: dict[PresetName, Preset] = {
    "preview": Preset((320, 240), 300),
    "good": Preset((640, 480), 2000),
    "final": Preset((1024, 768), 4000),
}
