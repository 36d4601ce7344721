"""Directions in which a term reflects much: drawn beside those of lights, so that neither a narrow highlight under a
wide sky nor a small sun above a dull floor is left to chance.

Local frame, z = normal. The density of a lobe is that of one of the term's own curves, constant between entries of its
table; what is drawn by any of several lobes is weighed by the densities of all (Veach and Guibas 1995).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Angle

F64 = NDArray[np.float64]

_HALF_ANGLES = (Angle.THETA_H, Angle.ALPHA, Angle.BETA, Angle.TILT_X, Angle.TILT_Y)
_MIRRORED = (-1.0, -1.0, 1.0)
_MIN_LENGTH = 1e-300


@dataclass(frozen=True)
class Lobe:
    """Directions, or half vectors, about an axis.

    Attributes:
        axes: what multiplies wo, axis by axis, to make the axis; None: the normal.
        is_half: half vectors are drawn and wo is mirrored by them.
        cdf: running sum over equal steps of the angle from the axis, 0 first, 1 last. (steps + 1,) float64
        pdf_table: within each step, per steradian. (steps,) float64
    """

    axes: tuple[float, float, float] | None
    is_half: bool
    cdf: F64
    pdf_table: F64

    def draw(self, wo: F64, num: int, rng: np.random.Generator) -> F64:
        """Directions about a lobe, some of them below the horizon.

        Args:
            wo: towards the viewer, local frame, unit. (n, 3) float64
            num: directions for each `wo`, stratified over the lobe.
            rng: where they are drawn from.
        Returns:
            Towards the light, local frame, unit. (n, num, 3) float64
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

    def pdf(self, wi: F64, wo: F64) -> F64:
        """Per steradian, of directions wi (n, m, 3) for wo (n, 3). (n, m)"""
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
        """The density at an angle from the axis; none beyond 90°."""
        angle = np.arccos(np.clip(cosine, 0.0, 1.0))
        step = np.minimum((angle * (len(self.pdf_table) / (0.5 * np.pi))).astype(np.intp), len(self.pdf_table) - 1)
        return np.asarray(np.where(cosine > 0, self.pdf_table[step], 0.0))


def cosine_lobe(steps: int = 1024) -> Lobe:
    """About the normal, as a surface sees light that it scatters everywhere."""
    edges = np.cos(np.linspace(0.0, 0.5 * np.pi, steps + 1))
    return _lobe(0.5 * (edges[1:] + edges[:-1]), None, is_half=False)  # type: ignore[return-value]


def curve_lobe(angle: Angle, axes: tuple[float, float, float], values: F64) -> Lobe | None:
    """The lobe of a curve; None where it turns with no direction that has a lobe, or is nothing.

    Args:
        angle: that the curve is a function of.
        axes: of the curve. values: at equal steps over [0, π/2], the mean of the channels. (steps + 1,)
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
    """Directions about +z (n, m, 3) turned to be about unit axes (n, 3)."""
    helper_axis = np.where(np.abs(axis[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    x = np.cross(helper_axis, axis)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.asarray(np.einsum("nmc,ncd->nmd", directions, np.stack([x, np.cross(axis, x), axis], axis=1)))
