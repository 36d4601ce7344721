"""Strengths of light sources by bounded least squares.

For each channel c, minimize over the strengths x of the free sources

    Σ_p w_p (Σ_s A_spc x_sc + b_pc − t_pc)² + λ W Σ_s n_sc² (x_sc − x⁰_sc)²,   0 ≤ x ≤ x_max,

with the images A of the sources, the constant b, the target t, the weights w, W = Σ_p w_p, the mean square n² of each
image and the current strengths x⁰. The ridge λ leaves sources where they are as far as the target does not decide.

Strokes keep the balance of the lights. Their ridge is that of relative changes, λ W E Σ_s (x_s/x⁰_s − 1)² with the
energy E = Σ_s n_s² x⁰_s², and each source moves only to the side on which it comes nearer to the target by itself:
none is turned off to make up for another one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from relume.core.errors import ParameterError, ShapeMismatchError
from relume.image_io.downsample import downsample
from relume.inverse_lighting.sources import Sources
from relume.look.light_validation import MAX_INTENSITY

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
SolveSystem = Callable[[F64, F64, F64, F64, tuple[F64, F64], NDArray[np.bool_]], F64]
RIDGE = 1e-3
_RELATIVE_ROUNDING = 1e-12
_ROUNDING = 1e-4  # of sums over the pixels of images, relative
_DIM = 0.2
"""RMS of a source, relative to √E, below which changes count relative to this: lights at 0 can be turned up, too."""
MAX_RADIANCE = 1e9
_LEAST_WEIGHT = np.float32(1e-4)


@dataclass(frozen=True)
class Target:
    """A target image. weights: of the squared error of each pixel, at least 0. radiance: linear; a pixel that is not
    finite has no weight, and a negative value is black."""

    radiance: Shaped[F32, "height width 3"]
    weights: Shaped[F32, "height width"]

    def averaged(self, side: int) -> Target:
        """Return the target of averaged blocks of pixels."""
        coverage = downsample(self.weights[..., None], _block_size(self.weights, side))[..., 0]
        return Target(average_blocks(self.radiance, self.weights, side), coverage)


def average_blocks(
    image: Shaped[F32, "height width channels"], weights: Shaped[F32, "height width"], side: int
) -> Shaped[F32, "rows columns channels"]:
    """Average an image over blocks of about `side` × `side` pixels, by weights; without any, all pixels count.

    Args:
        image: linear radiance. weights: of its pixels. side: of a block, in pixels.
    """
    size, some = _block_size(weights, side), np.maximum(weights, _LEAST_WEIGHT)[..., None]
    return np.asarray(downsample(image * some, size) / downsample(some, size), np.float32)


def _block_size(image: F32, side: int) -> tuple[int, int]:
    height, width = (max(1, round(pixels / side)) for pixels in image.shape[:2])
    return width, height


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations of a target, one system per channel: gram G = AᵀWA, rhs g = AᵀW(t − b), ridge W n²."""

    gram: Shaped[F64, "3 sources sources"]
    rhs: Shaped[F64, "3 sources"]
    ridge: Shaped[F64, "3 sources"]

    @classmethod
    def from_target(cls, sources: Sources, target: Target) -> NormalEquations:
        """Sum them over the pixels of a target.

        Raises:
            ShapeMismatchError: the target has another size than the images. ParameterError: a weight is negative or
                not finite.
        """
        if target.radiance.shape != sources.constant.shape or target.weights.shape != sources.constant.shape[:2]:
            raise ShapeMismatchError(
                f"the target has the shape {target.radiance.shape}, its weights {target.weights.shape}, and the image "
                f"{sources.constant.shape}; resize it"
            )
        radiance, weights = valid_target(target)
        images = sources.images.reshape(*sources.images.shape[:2], -1)
        weighted, wanted = images * weights.reshape(-1), (radiance - sources.constant).reshape(-1, 3)
        return cls(
            (weighted @ np.moveaxis(images, 1, 2)).astype(np.float64),
            np.einsum("csp,pc->cs", weighted, wanted, dtype=np.float64),
            float(weights.sum(dtype=np.float64)) * sources.mean_squares,
        )


def valid_target(target: Target) -> tuple[Shaped[F32, "height width 3"], Shaped[F32, "height width"]]:
    """Return radiance and weights of a target, both finite and at least 0.

    Raises:
        ParameterError: a weight is negative or not finite.
    """
    if not (np.isfinite(target.weights).all() and (target.weights >= 0.0).all()):
        raise ParameterError("weights", "weights below 0 or not finite", "numbers of at least 0")
    is_valid = np.asarray(np.isfinite(target.radiance).all(axis=-1))
    radiance = np.clip(np.where(is_valid[..., None], target.radiance, 0.0), 0.0, MAX_RADIANCE)
    return radiance.astype(np.float32), np.where(is_valid, target.weights, 0.0).astype(np.float32)


def solve_strengths(
    sources: Sources,
    equations: NormalEquations,
    is_free: Shaped[NDArray[np.bool_], " sources"],
    *,
    changes_color: bool,
    keeps_balance: bool,
    ridge: float = RIDGE,
) -> Shaped[F64, "sources 3"]:
    """Return the strengths that solve the normal equations.

    Args:
        sources: the sources. equations: of the target.
        is_free: false for sources that stay. A source stays, too, where its image is black.
        changes_color: whether channels change separately; otherwise intensities alone, with the current colors.
        keeps_balance: as for strokes; see above. ridge: λ.
    """
    solve = _solve_balanced if keeps_balance else _solve_system
    if changes_color:
        return _solve_channels(sources, equations, is_free, ridge, solve)
    return _solve_intensities(sources, equations, is_free, ridge, solve)


def _solve_channels(
    sources: Sources, equations: NormalEquations, is_free: NDArray[np.bool_], ridge: float, solve: SolveSystem
) -> Shaped[F64, "sources 3"]:
    limits = MAX_INTENSITY * sources.color_scales[:, 0]
    columns = [
        solve(gram, rhs, ridge * scale, current, (np.zeros_like(limits), limits), is_free)
        for gram, rhs, scale, current in zip(
            equations.gram, equations.rhs, equations.ridge, sources.strengths.T, strict=True
        )
    ]
    return np.stack(columns, axis=-1)


def _solve_intensities(
    sources: Sources, equations: NormalEquations, is_free: NDArray[np.bool_], ridge: float, solve: SolveSystem
) -> Shaped[F64, "sources 3"]:
    """Solve for the intensities, which joins the systems of the channels."""
    colors = sources.colors
    gram = np.einsum("sc,cst,tc->st", colors, equations.gram, colors)
    rhs = np.einsum("sc,cs->s", colors, equations.rhs)
    scale = np.einsum("sc,cs->s", np.square(colors), equations.ridge)
    limits = np.zeros(len(colors)), np.full(len(colors), MAX_INTENSITY)
    return solve(gram, rhs, ridge * scale, sources.intensities, limits, is_free)[:, None] * colors


def _solve_balanced(
    gram: F64, rhs: F64, ridge: F64, current: F64, limits: tuple[F64, F64], is_free: NDArray[np.bool_]
) -> Shaped[F64, " sources"]:
    """Solve the system with a ridge of relative changes, and each variable on one side of its current value."""
    squares = ridge * np.square(current)
    energy = squares.sum()
    relative = ridge * energy / np.maximum(squares, _DIM**2 * energy) if energy > 0.0 else ridge
    sides = _signs(rhs, gram @ current)
    lower, upper = np.where(sides > 0.0, current, limits[0]), np.where(sides < 0.0, current, limits[1])
    return _solve_system(gram, rhs, relative, current, (lower, upper), is_free & (sides != 0.0))


def _signs(wanted: F64, current: F64) -> F64:
    """Signs of the differences; 0 within rounding."""
    difference = wanted - current
    return np.where(np.abs(difference) > _ROUNDING * np.maximum(wanted, current), np.sign(difference), 0.0)


def _solve_system(
    gram: F64, rhs: F64, ridge: F64, current: F64, limits: tuple[F64, F64], is_free: NDArray[np.bool_]
) -> Shaped[F64, " sources"]:
    """Minimize xᵀGx − 2gᵀx + Σ ridge (x − current)² over the free variables within limits."""
    lower, upper = limits
    free = np.flatnonzero(is_free & (ridge > 0.0) & (lower < upper))
    strengths = current.copy()
    if not len(free) or not gram.any():
        return strengths
    fixed = np.setdiff1d(np.arange(len(current)), free)
    system = gram[np.ix_(free, free)] + np.diag(ridge[free])
    wanted = rhs[free] - gram[np.ix_(free, fixed)] @ current[fixed] + ridge[free] * current[free]
    scale = 1.0 / np.sqrt(np.diag(system))  # Jacobi: sources may differ by many orders of magnitude
    system *= scale[:, None] * scale
    factor = cholesky(system + _RELATIVE_ROUNDING * np.eye(len(free)))
    reduced = solve_triangular(factor, wanted * scale, trans="T")
    bounds = lower[free] / scale, upper[free] / scale
    strengths[free] = lsq_linear(factor, reduced, bounds, method="bvls").x * scale
    return strengths
