"""A BTF of a .btf container, side after side: products of its matrices, as linear RGB with the light's cosine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.bonn_container import damaged_error, read_container
from relume.assets.btf.direction_rings import directions
from relume.assets.btf.infer_directions import infer_rings
from relume.assets.btf.value_cache import MAX_VALUE
from relume.core.errors import MaterialError

F32 = NDArray[np.float32]

_LOG_OFFSET = np.float32(1e-5)  # that was added before logarithms were taken
_MAX_DEVIATION = 1e-3  # radians that light may come from where no eye is
_YUV = np.array([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]], np.float32)  # to RGB
_RGB, _OF_YUV, _LOG_Y, _LOG_Y_RATIOS, _LOG_RGB = 0, 1, 9, 11, 12
_MODELS = (_RGB, _OF_YUV, _LOG_Y, _LOG_Y_RATIOS, _LOG_RGB)


class MatrixBtf:
    """The values of a .btf file; implements `relume.assets.btf.compress.ViewArrays`.

    Args:
        path: of the file.
    Raises:
        MaterialError: it is no such file, damaged, too large, or its directions are not those of rings.
    """

    def __init__(self, path: Path) -> None:
        self._file = file = read_container(path)
        if file.model not in _MODELS:
            raise MaterialError(
                f"the .btf file has its colours by model {file.model}; {', '.join(map(str, _MODELS))} can be read: "
                "write it with one of them, or its images into a zip"
            )
        self.size = file.size
        self.grid, self._views = infer_rings(*np.degrees(file.views).T)
        light_grid, self._lights = infer_rings(*np.degrees(file.lights).T)
        view_directions, light_directions = directions(self.grid), directions(light_grid)
        if (
            light_directions.shape != view_directions.shape
            or np.abs(light_directions - view_directions).max() > _MAX_DEVIATION
        ):
            raise MaterialError("light and view directions of the BTF are not the same; resample it so that they are")
        self._cosine = np.cos(file.lights[self._lights, 0]).astype(np.float32)

    def get_view(self, view: int) -> F32:
        """Every texel's values from one direction; what a product has below zero is zero. (lights, texels, 3) float32

        Raises:
            MaterialError: some are no numbers.
        """
        pairs = self._views[view] * len(self._lights) + self._lights
        out = np.empty((len(pairs), self.size[0] * self.size[1], 3), np.float32)
        with np.errstate(over="ignore", invalid="ignore"):  # looked for below
            for channel, factors in enumerate(self._file.channels):
                out[:, :, channel] = factors.pairs[pairs].astype(np.float32) @ factors.texels.astype(np.float32).T
            out = _rgb(self._file.model, out)
        if not np.isfinite(out).all():
            raise damaged_error("some of its values are no numbers, or too large")
        if not self._file.has_cosine:
            out *= self._cosine[:, None, None]
        return np.clip(out, 0, MAX_VALUE, out=out)


def _rgb(model: int, values: F32) -> F32:
    """What channels mean. values: (..., 3), used up"""
    if model == _RGB:
        return values
    if model == _LOG_RGB:
        return np.asarray(np.exp(values) - _LOG_OFFSET)
    if model in (_LOG_Y, _LOG_Y_RATIOS):
        values[..., 0] = np.exp(values[..., 0]) - _LOG_OFFSET
    if model == _LOG_Y_RATIOS:
        values[..., 1:] *= values[..., :1] + _LOG_OFFSET
    return np.asarray(values @ _YUV.T)
