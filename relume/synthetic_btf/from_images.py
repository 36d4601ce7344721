"""A material from images of one period: heights, colors, or both, as of leather, felt, wallpaper and print."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import PIL.Image

from relume.core.errors import ParameterError, SceneError
from relume.image_io.decode import Decoder
from relume.scene.model import Texture, TextureEncoding
from relume.scene_io.import_scene import read_file
from relume.synthetic_btf.from_mesh import MAX_FACES
from relume.synthetic_btf.tileable_geometry import F64, Tile, height_field

_MAX_STEPS = int((MAX_FACES / 2) ** 0.5)  # of the height field, per side
_MAX_RELIEF = 0.5  # periods
_F0 = 0.04  # of leather, paint and paper
_GRAY = (0.5, 0.5, 0.5)  # without an image of colors
_SQUARE_TOLERANCE = 0.02  # relative difference between the sides of an image that counts as a square


class ReliefTile(NamedTuple):
    """Images of one period, seen from above, that continue across opposite sides.

    Attributes:
        height: image of heights, black lowest; None for a plane. color: image of diffuse colors, sRGB; None for gray.
        relief: height of white over black, in periods.
        roughness: of the gloss over the colors; 1 is almost matte.
    """

    height: Path | None
    color: Path | None
    relief: float
    roughness: float

    def check(self) -> None:
        """Raise ParameterError if a value is out of range."""
        if not 0 < self.relief <= _MAX_RELIEF:
            raise ParameterError("--relief", self.relief, f"a fraction of the image's side up to {_MAX_RELIEF:g}")
        if not 0.05 <= self.roughness <= 1:
            raise ParameterError("--roughness", self.roughness, "a number from 0.05 to 1")

    def read(self) -> Tile:
        """Read the images. Raises SceneError if one is unusable."""
        height = np.zeros((2, 2)) if self.height is None else self.relief * _read_heights(self.height)
        textured = None if self.color is None else "diffuse"
        terms = (
            {"model": "lambert", "color": list(_GRAY if self.color is None else (1.0, 1.0, 1.0)), "texture": textured},
            {"model": "ggx", "color": [1.0, 1.0, 1.0], "params": {"roughness": self.roughness, "f0": _F0}},
        )
        tile = Tile.with_single_material(*height_field(height), terms)
        if self.color is None:
            return tile
        pixels = np.ascontiguousarray(Decoder().decode(read_file(self.color), self.color.name)[..., :3])
        _check_square(pixels.shape[:2], self.color)
        half = 0.5 / (len(height) - 1) if self.height is not None else 0.0  # a vertex is the center of a pixel
        texture = Texture(pixels, encoding=TextureEncoding("srgb"))
        return tile._replace(uvs=tile.uvs + np.array([half, -half]), textures=({"diffuse": texture},))


def _read_heights(path: Path) -> F64:
    """Heights in [0, 1] by y and x, both rising, the first row and column repeated. (steps + 1, steps + 1)"""
    gray = Decoder().decode_gray(read_file(path), path.name)
    _check_square(gray.shape[:2], path)
    steps = min(_MAX_STEPS, min(gray.shape))
    image = PIL.Image.fromarray(gray).resize((steps, steps), PIL.Image.Resampling.BOX)
    return np.pad(np.asarray(image, np.float64)[::-1], ((0, 1), (0, 1)), "wrap")


def _check_square(shape: tuple[int, ...], path: Path) -> None:
    if max(shape) > (1 + _SQUARE_TOLERANCE) * min(shape):
        raise SceneError(f"{path.name!r} is {shape[1]}×{shape[0]}; the image of a period is a square, crop it")
