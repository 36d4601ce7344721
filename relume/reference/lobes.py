"""Importance sampling of BRDF lobes, combined with sampling of lights, so that neither a narrow highlight under a wide
environment nor a small sun above a diffuse floor causes noise.

Local frame, z = normal. The density of a lobe is proportional to one of the term's curves, constant between entries of
its table; samples of several lobes are weighted by the densities of all (Veach and Guibas 1995).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Angle

F64 = NDArray[np.float64]

_HALF_ANGLES = (Angle.THETA_H, Angle.ALPHA, Angle.BETA, Angle.TILT_X, Angle.TILT_Y)
_MIRRORED = (-1.0, -1.0, 1.0)
_MIN_LENGTH = 1e-300


@dataclass(frozen=True)
class Lobe:
    """Distribution of directions, or half vectors, around an axis.

    Attributes:
        axes: factors of the components of wo that give the axis; None: the normal.
        is_half: half vectors are sampled, and wo is reflected at them.
        cdf: over equal steps of the angle from the axis, from 0 to 1.
        pdf_table: density within each step, 1/sr.
    """

    axes: tuple[float, float, float] | None
    is_half: bool
    cdf: Shaped[F64, " edges"]
    pdf_table: Shaped[F64, " steps"]

    def draw(self, wo: Shaped[F64, "n 3"], num: int, rng: np.random.Generator) -> Shaped[F64, "n num 3"]:
        """Sample directions toward the light; some are below the horizon.

        Args:
            wo: toward the viewer, local frame, unit.
            num: directions per `wo`, stratified over the lobe.
            rng: random number generator.
        """
        strata = (np.arange(num) + rng.random((len(wo), num))) / num
        step = np.minimum(np.searchsorted(self.cdf, strata, side="right") - 1, len(self.pdf_table) - 1)
        low, high = (np.cos(edge * 0.5 * np.pi / len(self.pdf_table)) for edge in (step, step + 1))
        cosine = low + rng.random(step.shape) * (high - low)
        sine, phi = np.sqrt(np.maximum(0.0, 1 - cosine**2)), 2 * np.pi * rng.random(step.shape)
        directions = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=-1)
        if self.axes is not None:
            return _rotate(directions, self._axis(wo))
        if not self.is_half:
            return np.asarray(directions)
        return np.asarray(2 * np.einsum("nmc,nc->nm", directions, wo)[..., None] * directions - wo[:, None])

    def pdf(self, wi: Shaped[F64, "n m 3"], wo: Shaped[F64, "n 3"]) -> Shaped[F64, "n m"]:
        """Density of directions wi for wo, 1/sr."""
        if not self.is_half:
            cosine = wi[..., 2] if self.axes is None else np.einsum("nmc,nc->nm", wi, self._axis(wo))
            return self._pdf_at(cosine)
        half = wi + wo[:, None]
        length = np.maximum(np.linalg.norm(half, axis=-1), 1e-12)
        return np.asarray(self._pdf_at(half[..., 2] / length) / (2 * length))  # |wi + wo| = 2 cos θd

    def _axis(self, wo: F64) -> F64:
        axis = wo * np.array(self.axes)
        return np.asarray(axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), _MIN_LENGTH))

    def _pdf_at(self, cosine: F64) -> F64:
        """Density at an angle from the axis; zero beyond 90°."""
        angle = np.arccos(np.clip(cosine, 0.0, 1.0))
        step = np.minimum((angle * (len(self.pdf_table) / (0.5 * np.pi))).astype(np.intp), len(self.pdf_table) - 1)
        return np.asarray(np.where(cosine > 0, self.pdf_table[step], 0.0))


def cosine_lobe(steps: int = 1024) -> Lobe:
    """Make the cosine-weighted lobe around the normal."""
    edges = np.cos(np.linspace(0.0, 0.5 * np.pi, steps + 1))
    return _lobe(0.5 * (edges[1:] + edges[:-1]), None, is_half=False)  # type: ignore[return-value]


def curve_lobe(angle: Angle, axes: tuple[float, float, float], values: Shaped[F64, " entries"]) -> Lobe | None:
    """Make the lobe of a curve; None if its angle has no lobe, or the curve is zero.

    Args:
        angle: argument of the curve.
        axes: axes of the curve. values: values at equal steps over [0, π/2], mean of the channels.
    """
    midpoints = 0.5 * (values[1:] + values[:-1])
    if angle in _HALF_ANGLES:
        edges = np.cos(np.linspace(0.0, 0.5 * np.pi, len(values)))
        return _lobe(midpoints * 0.5 * (edges[1:] + edges[:-1]), None, is_half=True)
    if angle in (Angle.THETA_R, Angle.LOBE):
        return _lobe(midpoints, _MIRRORED if angle is Angle.THETA_R else axes, is_half=False)
    return None


def _lobe(values: F64, axes: tuple[float, float, float] | None, *, is_half: bool) -> Lobe | None:
    edges = np.cos(np.linspace(0.0, 0.5 * np.pi, len(values) + 1))
    weight = values * 2 * np.pi * (edges[:-1] - edges[1:])
    total = float(weight.sum())
    if not total > 0:
        return None
    cdf = np.concatenate([[0.0], np.cumsum(weight) / total])
    return Lobe(axes, is_half, cdf / cdf[-1], values / total)


def _rotate(directions: F64, axis: F64) -> F64:
    """Rotate directions around +z (n, m, 3) to unit axes (n, 3)."""
    helper_axis = np.where(np.abs(axis[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    x = np.cross(helper_axis, axis)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.asarray(np.einsum("nmc,ncd->nmd", directions, np.stack([x, np.cross(axis, x), axis], axis=1)))
