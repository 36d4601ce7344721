"""A BTF of a .btf container, view by view: products of its matrices, as linear RGB with the light's cosine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.bonn_container import damaged_error, read_container
from relume.assets.btf.direction_rings import directions
from relume.assets.btf.infer_directions import infer_rings
from relume.assets.btf.value_cache import MAX_VALUE
from relume.core.errors import MaterialError

F32 = NDArray[np.float32]

_LOG_OFFSET = np.float32(1e-5)  # added by the container before logarithms
_MAX_DEVIATION = 1e-3  # radians between light and view directions
_YUV = np.array([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]], np.float32)  # to RGB
_RGB, _OF_YUV, _LOG_Y, _LOG_Y_RATIOS, _LOG_RGB = 0, 1, 9, 11, 12
_MODELS = (_RGB, _OF_YUV, _LOG_Y, _LOG_Y_RATIOS, _LOG_RGB)


class MatrixBtf:
    """The values of a .btf file; implements `relume.assets.btf.compressed_view.ViewArrays`.

    Args:
        path: path of the file.
    Raises:
        MaterialError: the file is of another kind, damaged or too large, or its directions are not rings.
    """

    def __init__(self, path: Path) -> None:
        self._file = file = read_container(path)
        if file.model not in _MODELS:
            raise MaterialError(
                f"the .btf file has the unsupported color model {file.model}; write it with one of "
                f"{', '.join(map(str, _MODELS))}, or its images to a zip"
            )
        self.size = file.size
        self.grid, self._views = infer_rings(*np.degrees(file.views).T)
        light_grid, self._lights = infer_rings(*np.degrees(file.lights).T)
        view_directions, light_directions = directions(self.grid), directions(light_grid)
        if (
            light_directions.shape != view_directions.shape
            or np.abs(light_directions - view_directions).max() > _MAX_DEVIATION
        ):
            raise MaterialError("light and view directions of the BTF are different; resample it to the same ones")
        self._cosine = np.cos(file.lights[self._lights, 0]).astype(np.float32)

    def get_view(self, view: int) -> Shaped[F32, "lights texels 3"]:
        """Values of all texels from one view direction; negative products are clamped to zero.

        Raises:
            MaterialError: values are not finite.
        """
        pairs = self._views[view] * len(self._lights) + self._lights
        out = np.empty((len(pairs), self.size[0] * self.size[1], 3), np.float32)
        with np.errstate(over="ignore", invalid="ignore"):  # checked below
            for channel, factors in enumerate(self._file.channels):
                out[:, :, channel] = factors.pairs[pairs].astype(np.float32) @ factors.texels.astype(np.float32).T
            out = _rgb(self._file.model, out)
        if not np.isfinite(out).all():
            raise damaged_error("some of its values are not finite")
        if not self._file.has_cosine:
            out *= self._cosine[:, None, None]
        return np.clip(out, 0, MAX_VALUE, out=out)


def _rgb(model: int, values: F32) -> F32:
    """Convert from the container's color model. values: (..., 3), modified"""
    if model == _RGB:
        return values
    if model == _LOG_RGB:
        return np.asarray(np.exp(values) - _LOG_OFFSET)
    if model in (_LOG_Y, _LOG_Y_RATIOS):
        values[..., 0] = np.exp(values[..., 0]) - _LOG_OFFSET
    if model == _LOG_Y_RATIOS:
        values[..., 1:] *= values[..., :1] + _LOG_OFFSET
    return np.asarray(values @ _YUV.T)
