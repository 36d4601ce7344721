"""UV coordinates of a material with several textures, each of which has a transform of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, unsupported
from relume.math.uv_transform import UvTransform
from relume.scene.model import F32

U8 = NDArray[np.uint8]
Wrap = tuple[str, str]
UvSet = int | str
Tiling = tuple[tuple[int, int], tuple[float, float]]
_NO_TILING: Tiling = ((1, 1), (0.0, 0.0))
_MAX_TILED = 8192  # texels per side
_MAX_REPEAT_ERROR = 1e-4


@dataclass(frozen=True)
class UvSlot:
    """A set of UV coordinates, by its number or name in the file, with a transform."""

    uv_set: UvSet = 0
    transform: UvTransform = field(default_factory=UvTransform)

    def apply(self, sets: Mapping[Any, Shaped[F32, "vertices 2"]], num_vertices: int) -> Shaped[F32, "vertices 2"]:
        """Transform UV coordinates.

        Args:
            sets: by number or name; if the slot's is missing, the first one is used, or zeros.
        """
        if not sets:
            return np.zeros((num_vertices, 2), np.float32)
        coordinates = sets.get(self.uv_set, sets[min(sets)])
        return np.clip(self.transform.points(coordinates), np.float32(-1e6), np.float32(1e6))


class UvTransforms:
    """Brings all textures of a material to common UV coordinates; textures that repeat more often are tiled.

    Attributes:
        slot: UV coordinates for the meshes.
    """

    def __init__(self, slots: Sequence[UvSlot], label: str, warnings: list[ImporterWarning]) -> None:
        """Choose the common UV coordinates.

        Args:
            slots: of the textures of the material; the first decides if no common transform exists.
            label: names the material in warnings. warnings: gets a sentence if a texture has another transform.
        """
        self._label, self._warnings = label, warnings
        candidates = (candidate for candidate in slots if all(tiling(slot, candidate) is not None for slot in slots))
        self.slot = next(candidates, slots[0] if slots else UvSlot())
        self._has_warned = False

    def is_tiled(self, slot: UvSlot) -> bool:
        """True if `tile_image` tiles a texture with these UV coordinates."""
        layout = tiling(slot, self.slot)
        return layout is not None and layout[0] != (1, 1)

    def tile_image(self, slot: UvSlot, pixels: Shaped[U8, "height width channels"], wrap: Wrap) -> U8:
        """Tile an image to be sampled at the meshes' UV coordinates.

        Args:
            slot: of the texture. pixels: top row first. wrap: wrap mode of the texture.
        """
        layout = tiling(slot, self.slot)
        if layout == _NO_TILING or pixels.shape[:2] == (1, 1):
            return pixels
        height, width = pixels.shape[:2]
        if layout is not None and wrap == ("repeat", "repeat"):
            (across, down), (right, below) = layout
            if max(width * across, height * down) <= _MAX_TILED:
                shift = round(-below * height) % height, round(-right * width) % width
                return np.tile(np.roll(pixels, shift, axis=(0, 1)), (down, across, 1))
        if not self._has_warned:
            message = f"The textures of {self._label} have different UV transforms, which can't be combined; all use"
            self._warnings.append(unsupported(f"{message} the same one."))
        self._has_warned = True
        return pixels


def tiling(slot: UvSlot, base_slot: UvSlot) -> Tiling | None:
    """Find how often an image repeats within another's UV range along u and v, and its offset there.

    Returns:
        None if the number is not whole, or the rotations differ.
    """
    transform, base_transform = slot.transform, base_slot.transform
    if slot == base_slot:
        return _NO_TILING
    if slot.uv_set != base_slot.uv_set or transform.rotation != base_transform.rotation or 0 in base_transform.scale:
        return None
    repeats = np.array(transform.scale) / base_transform.scale
    whole = np.rint(repeats)
    if (
        (whole < 1).any()
        or np.abs(repeats - whole).max() > _MAX_REPEAT_ERROR
        or (transform.rotation and repeats[0] != repeats[1])
    ):
        return None
    across, down = (int(min(number, _MAX_TILED)) for number in whole)
    right, below = (np.array(transform.offset) - whole * base_transform.offset).tolist()
    return (across, down), (right, below)
