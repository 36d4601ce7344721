"""Curves of a measured BRDF: rank-one factorizations, whose residual is the quotient of a term.

M ≈ g(θi) g(θo) + f(θh) f'(θd)     eq. 18, Ben-Artzi 2006; non-negative
M ≈ P(θi) Q(θh) P(θo)              eq. 17; homomorphic, McCool 2001
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from scipy import sparse

from relume.assets.measured.interpolate import F32, NUM_KNOTS, THETA_D, THETA_H, THETA_I, THETA_O, evaluate_measured
from relume.assets.measured.merl import CHANNEL_SCALE, F64, grid_angles, grid_directions, is_measured

FLOOR = 1e-6
_ROUNDS = 60
_AZIMUTHS = 36
_LOW_QUANTILE = 0.1  # over the azimuth, for the diffuse-like lobe; robust against noise of single values
_SMOOTHNESS_WEIGHT = 1e-5  # in squared logarithms; extrapolates curves linearly where nothing was measured
_PHI_STRIDE = 6


@dataclass(frozen=True)
class MeasuredFactors:
    """The curves of one material at their knots, rows θi, θh, θd, θo; positive.

    Attributes:
        lobes: curves of `measured_lv` and `measured_hd`. homomorphic: curves of `measured_hf`; one for θd.
        lobes_error, homomorphic_error: errors of the products alone, for R, G, B; see `relative_error`.
    """

    lobes: Shaped[F64, "4 3 90"]
    homomorphic: Shaped[F64, "4 3 90"]
    lobes_error: tuple[float, ...]
    homomorphic_error: tuple[float, ...]


def factorize(planes: Shaped[F64, "3 90 90 180"], table: Shaped[F32, "90 90 180 3"]) -> MeasuredFactors:
    """Factorize a measured BRDF.

    Args:
        planes: measured values, from `read_merl`. table: from `relume.assets.measured.interpolate.build_table`.
    """
    grid = _Grid(planes)
    lobes, homomorphic = np.ones((4, 3, NUM_KNOTS)), np.ones((4, 3, NUM_KNOTS))
    lobes[THETA_I] = lobes[THETA_O] = _diffuse_curves(table)
    product = grid.at_theta_i(lobes[THETA_I]) * grid.at_theta_o(lobes[THETA_O])
    lobes[THETA_H], lobes[THETA_D] = grid.specular_curves(np.maximum(grid.values - product, 0.0))
    product += lobes[THETA_H][:, :, None, None] * lobes[THETA_D][:, None, :, None]
    homomorphic[THETA_I], homomorphic[THETA_H] = grid.homomorphic_curves()
    homomorphic[THETA_O] = homomorphic[THETA_I]
    homomorphic_product = (
        grid.at_theta_i(homomorphic[THETA_I]) * grid.at_theta_o(homomorphic[THETA_O])
        * homomorphic[THETA_H][:, :, None, None]
    )  # fmt: skip
    return MeasuredFactors(lobes, homomorphic, grid.relative_error(product), grid.relative_error(homomorphic_product))


def factorize_rank_one(
    matrix: Shaped[F64, "n m"], weight: Shaped[F64, "n m"]
) -> tuple[Shaped[F64, " n"], Shaped[F64, " m"]]:
    """Minimize the Itakura–Saito divergence of u vᵀ from a matrix, with non-negative u and v and max(v) = 1.

    Févotte 2009; for rank one, the alternating updates have a closed form: each factor is the weighted mean of matrix ÷
    other factor. The quotient matrix ÷ u vᵀ is therefore one on average at every knot of either curve.

    Args:
        matrix, weight: not negative.
    Returns:
        u and v, positive; rows and columns without weight are interpolated from their neighbors.
    """
    u, v = np.ones(matrix.shape[0]), np.ones(matrix.shape[1])
    for _ in range(_ROUNDS):
        u = _clamp_above_zero(_mean(matrix / v, weight, 1))
        v = _clamp_above_zero(_mean(matrix / u[:, None], weight, 0))
        u, v = u * v.max(), v / v.max()
    return _clamp_above_zero(u), _clamp_above_zero(v)


def _mean(ratios: F64, weight: F64, axis: int) -> F64:
    """Weighted mean along an axis, interpolated between neighbors if there is no weight."""
    total = weight.sum(axis=axis)
    has_weight = total > FLOOR * total.max() if total.any() else np.zeros(len(total), np.bool_)
    if not has_weight.any():
        return np.zeros(len(total))
    index = np.arange(len(total))
    return np.asarray(
        np.interp(index, index[has_weight], (ratios * weight).sum(axis=axis)[has_weight] / total[has_weight])
    )


def _clamp_above_zero(curve: F64) -> F64:
    """Clamp a curve to divide by: at least `FLOOR` of its peak, and at least `FLOOR` per steradian."""
    return np.maximum(curve, FLOOR * max(float(curve.max()), 1.0))


def _diffuse_curves(table: F32) -> F64:
    """g at its knots, per channel: the part of a material that does not depend on the azimuth. (3, 90)

    g(θi) g(θo) is fitted to a low quantile over the azimuth, since a highlight covers only a part of it.
    """
    theta = np.arange(NUM_KNOTS) * (math.pi / 2 / NUM_KNOTS)
    phi = (np.arange(_AZIMUTHS) + 0.5) * (math.pi / _AZIMUTHS)
    wi = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], -1)[:, None, None]
    wo_theta = theta[:, None]
    wo = np.stack(
        np.broadcast_arrays(np.sin(wo_theta) * np.cos(phi), np.sin(wo_theta) * np.sin(phi), np.cos(wo_theta)), -1
    )
    low = np.quantile(evaluate_measured(table, wi, wo[None]), _LOW_QUANTILE, axis=2)
    weight = np.outer(np.cos(theta) * np.sin(theta), np.cos(theta) * np.sin(theta))
    curves = []
    for channel in range(3):
        u, v = factorize_rank_one(low[..., channel], weight)
        # the matrix is symmetric: u and v differ by scale and rounding
        curves.append(_clamp_above_zero(np.sqrt(u * v)))
    return np.array(curves)


class _Grid:
    """The measured values at the nodes of the file, with weights for means over all pairs of directions."""

    def __init__(self, planes: F64) -> None:
        measured = is_measured(planes)
        self.values = np.where(measured, planes * CHANNEL_SCALE[:, None, None, None], 0.0)
        wi, wo = grid_directions()
        cos_i, cos_o = wi[..., 2], wo[..., 2]
        self.theta_i, self.theta_o = (np.arccos(np.clip(cosine, 0.0, 1.0)) for cosine in (cos_i, cos_o))
        theta_h, theta_d, _ = grid_angles()
        # dωi dωo = 4 cos θd dωh dωd; the spacing of the nodes of θh is proportional to its square root
        solid_angle = np.sin(theta_h) * np.sqrt(theta_h) * np.sin(theta_d) * np.cos(theta_d)
        cosine_weight = np.maximum(cos_i, 0.0) * np.maximum(cos_o, 0.0) * measured
        self._cosine_weight, self._weight = cosine_weight, cosine_weight * solid_angle

    def at_theta_i(self, curve: F64) -> F64:
        """Evaluate a curve of θi at all nodes. (3, 90) -> (3, 90, 90, 180)"""
        return _interpolate_curve(self.theta_i, curve)

    def at_theta_o(self, curve: F64) -> F64:
        """Evaluate a curve of θo at all nodes."""
        return _interpolate_curve(self.theta_o, curve)

    def specular_curves(self, residual: F64) -> tuple[F64, F64]:
        """f(θh) and f'(θd) of the residual of the diffuse-like lobe, averaged over φd. (3, 90) each

        Weights include its fraction of the whole, since it is noise if the diffuse-like lobe dominates.
        """
        weight = self._cosine_weight.sum(axis=2)
        mean, whole = (
            (values * self._cosine_weight).sum(axis=3) / np.where(weight > 0, weight, 1.0)
            for values in (residual, self.values)
        )
        weight *= np.sin(2 * grid_angles()[1].ravel())  # dωd, which vanishes at both ends of θd
        residual_ratio = np.divide(mean, whole, out=np.zeros_like(mean), where=whole > 0)
        pairs = [
            factorize_rank_one(channel, weight * channel_ratio)
            for channel, channel_ratio in zip(mean, residual_ratio, strict=True)
        ]
        return np.array([u for u, _ in pairs]), np.array([v for _, v in pairs])

    def homomorphic_curves(self) -> tuple[F64, F64]:
        """P and Q: linear least squares on logarithms over the nodes, P(0) one. (3, 90) each"""
        phi = slice(None, None, _PHI_STRIDE)
        weight = self._cosine_weight[..., phi].ravel()
        rows = np.nonzero(weight > 0)[0]
        num = len(rows)
        theta_i, theta_o = self.theta_i[..., phi].ravel()[rows], self.theta_o[..., phi].ravel()[rows]
        theta_h_design = sparse.csr_array(
            (np.ones(num), (np.arange(num), NUM_KNOTS + rows // (self._cosine_weight[0, :, phi].size))),
            (num, 2 * NUM_KNOTS),
        )
        design = _hat_design(theta_i) + _hat_design(theta_o) + theta_h_design
        values = self.values[..., phi].reshape(3, -1)[:, rows]
        logarithm = np.log(np.maximum(values, FLOOR * values.max(axis=1, keepdims=True) + 1e-30))
        weighted = design.T @ sparse.dia_array((weight[rows][None], [0]), (num, num))
        second_difference = np.diff(np.eye(NUM_KNOTS), 2, axis=0)
        smooth = np.kron(np.eye(2), second_difference.T @ second_difference) + FLOOR * np.eye(2 * NUM_KNOTS)
        normal = (weighted @ design).toarray() + _SMOOTHNESS_WEIGHT * weight.sum() / NUM_KNOTS * smooth
        p, q = np.split(np.linalg.solve(normal, weighted @ logarithm.T).T, 2, axis=1)
        q, p = q + 2 * p[:, :1], p - p[:, :1]
        return np.array([_clamp_above_zero(c) for c in np.exp(p)]), np.array([_clamp_above_zero(c) for c in np.exp(q)])

    def relative_error(self, product: F64) -> tuple[float, ...]:
        """√(Σ w (product − M)² / Σ w M²) over all measured values, w = cos θi cos θo dωi dωo; for R, G, B."""
        squared_error = (np.square(product - self.values) * self._weight).sum(axis=(1, 2, 3))
        whole = (np.square(self.values) * self._weight).sum(axis=(1, 2, 3))
        return tuple(float(e) for e in np.sqrt(squared_error / np.where(whole > 0, whole, 1.0)))


def _interpolate_curve(theta: F64, curve: F64) -> F64:
    position = theta * (NUM_KNOTS / (math.pi / 2))
    return np.stack([np.interp(position, np.arange(NUM_KNOTS), channel) for channel in curve])


def _hat_design(theta: F64) -> sparse.csr_array:
    """Rows of a design matrix: the two knots around each angle with their weights. (n, 180)"""
    position = np.minimum(theta * (NUM_KNOTS / (math.pi / 2)), NUM_KNOTS - 1.0)
    node = np.minimum(position.astype(np.intp), NUM_KNOTS - 2)
    fraction = position - node
    rows = np.arange(len(theta))
    return sparse.csr_array(
        (np.concatenate([1 - fraction, fraction]), (np.tile(rows, 2), np.concatenate([node, node + 1]))),
        (len(theta), 2 * NUM_KNOTS),
    )
