"""Intensity of a point light over directions: an IES web, the projection of a gobo, or their product, as a table.

    J(θ, φ) = web(θ, −φ) · gobo(u, v) / mean,   u, v = ½ − tan θ (cos φ, sin φ) / (2 tan θ_outer)

θ is measured from the light's direction, φ about it, from the horizontal axis of `relume.lights.light_axes` toward the
upright one, clockwise as seen along it. Azimuths C of a web are counterclockwise as seen from behind the light, that is
from above a luminaire, so C = −φ. The gobo fills the square about the cone, upright and unmirrored along the direction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import LUMINANCE
from relume.raytrace.emission_image import is_colored
from relume.raytrace.texture import sample_image
from relume.scene.model import Texture

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_GOBO_POLAR_ANGLES, _GOBO_AZIMUTHS = 257, 1025
_WEB_POLAR_ANGLES = 721
_MIN_MEAN = 1e-6  # of a channel of a gobo; below, it lets no light through


class Gobo(NamedTuple):
    """A gobo as a cone sees it.

    Attributes:
        values: linear RGB at equidistant θ up to the edge of the cone, and φ. mean: over the cone's solid angle.
        is_colored: its color varies.
    """

    values: Shaped[F32, "polar azimuth 3"]
    mean: tuple[float, float, float]
    is_colored: bool

    def relative_intensity(self, channel: int | None) -> Shaped[F32, "polar azimuth"]:
        """Return the gobo over its mean, of a channel or, for None, of luminance."""
        weights = np.array(LUMINANCE) if channel is None else np.eye(3)[channel]
        return np.asarray(self.values @ weights / max(float(np.array(self.mean) @ weights), _MIN_MEAN), np.float32)


def project_gobo(image: Texture, outer: float) -> Gobo:
    """Project an image over a cone. outer: its half-angle, degrees, less than 90"""
    polar, azimuth = _grid(outer, _GOBO_POLAR_ANGLES, _GOBO_AZIMUTHS)
    radius = (np.tan(polar) / np.tan(np.radians(outer)))[:, None]
    u, v = 0.5 - radius * np.cos(azimuth) / 2, 0.5 - radius * np.sin(azimuth) / 2
    # the side of a cell of the table in the image: the edge is as sharp as the table
    footprint = np.broadcast_to(np.gradient(radius[:, 0])[:, None] / 2, u.shape)
    values = sample_image(image, np.stack([u, v, footprint], axis=-1).reshape(-1, 3).astype(np.float32))
    solid_angle = np.repeat(np.sin(polar), _GOBO_AZIMUTHS)
    mean = solid_angle @ values.astype(np.float64) / solid_angle.sum()
    red, green, blue = mean.tolist()
    return Gobo(values.reshape(*u.shape, 3), (red, green, blue), is_colored(values, mean, solid_angle))


def intensity_table(
    outer: float, web: Shaped[F32, "polar azimuth"] | None, gobo: Shaped[F32, "rows columns"] | None
) -> Shaped[F32, "table_polar table_azimuth"]:
    """Return J at equidistant θ in [0, outer] and φ in [0, 2π], or one φ if all are equal.

    Args:
        outer: half-angle of the cone, degrees; 180 for a point light.
        web: at θ in [0, π], see `relume.assets.ies.read_ies.PhotometricWeb`.
        gobo: from `Gobo.relative_intensity`.
    """
    if web is None:
        return np.ones((1, 1), np.float32) if gobo is None else gobo
    shape = (_WEB_POLAR_ANGLES, web.shape[1]) if gobo is None else gobo.shape
    polar, azimuth = _grid(outer, *shape)
    rows, columns = polar / np.pi * (web.shape[0] - 1), (1 - azimuth / (2 * np.pi)) * (web.shape[1] - 1)
    table = _interpolate_rows(_interpolate_rows(web, rows).T, columns).T
    return np.ascontiguousarray(table if gobo is None else table * gobo, np.float32)


def _grid(outer: float, num_polar: int, num_azimuths: int) -> tuple[Shaped[F64, " polar"], Shaped[F64, " azimuth"]]:
    """Equidistant angles of a table, radians."""
    return np.linspace(0, np.radians(outer), num_polar), np.linspace(0, 2 * np.pi, num_azimuths)


def _interpolate_rows(
    table: Shaped[F32 | F64, "rows columns"], position: Shaped[F64, " n"]
) -> Shaped[F64, "n columns"]:
    """Interpolate between the rows of a table linearly."""
    row = np.minimum(position.astype(np.intp), max(len(table) - 2, 0))
    fraction = (position - row)[:, None]
    return np.asarray((1 - fraction) * table[row] + fraction * table[np.minimum(row + 1, len(table) - 1)])
