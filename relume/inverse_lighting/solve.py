"""Strengths of light sources by bounded least squares.

For each channel c, minimize over the strengths x of the free sources

    Σ_p w_p (Σ_s A_spc x_sc + b_pc − t_pc)² + λ W Σ_s n_sc² (x_sc − x⁰_sc)²,   0 ≤ x ≤ x_max,

with the images A of the sources, the constant b, the target t, the weights w, W = Σ_p w_p, the mean square n² of each
image and the current strengths x⁰. The ridge λ leaves sources where they are as far as the target does not decide.

Strokes keep the balance of the lights. Their ridge is that of relative changes, λ W E Σ_s (x_s/x⁰_s − 1)² with the
energy E = Σ_s n_s² x⁰_s², and a source is turned up only if the target is brighter where it shines, and down only if
it is darker there: none is turned off to make up for another one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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
RIDGE = 1e-3
_RELATIVE_ROUNDING = 1e-12
_ASKED = 0.01
"""A target asks for more of a source from this difference on, relative to the target where the source shines."""
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
    """Normal equations of a target, one system per channel: gram G = AᵀWA, rhs g = AᵀW(t − b), ridge W n².

    rises, falls: whether the target is brighter or darker than the current image where a source shines.
    """

    gram: Shaped[F64, "3 sources sources"]
    rhs: Shaped[F64, "3 sources"]
    ridge: Shaped[F64, "3 sources"]
    rises: Shaped[NDArray[np.bool_], "3 sources"]
    falls: Shaped[NDArray[np.bool_], "3 sources"]

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
        added = radiance - sources.image(sources.strengths)
        total, rise, fall = (
            np.einsum("csp,pc->cs", weighted, each.reshape(-1, 3))
            for each in (radiance, np.maximum(added, 0.0), np.maximum(-added, 0.0))
        )
        return cls(
            (weighted @ np.moveaxis(images, 1, 2)).astype(np.float64),
            np.einsum("csp,pc->cs", weighted, wanted, dtype=np.float64),
            float(weights.sum(dtype=np.float64)) * sources.mean_squares,
            rise > _ASKED * total,
            fall > _ASKED * total,
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
    if changes_color:
        return _solve_channels(sources, equations, is_free, ridge, keeps_balance=keeps_balance)
    return _solve_intensities(sources, equations, is_free, ridge, keeps_balance=keeps_balance)


def _solve_channels(
    sources: Sources, equations: NormalEquations, is_free: NDArray[np.bool_], ridge: float, *, keeps_balance: bool
) -> Shaped[F64, "sources 3"]:
    limits = MAX_INTENSITY * sources.color_scales[:, 0]
    columns = []
    for c, current in enumerate(sources.strengths.T):
        system = _System(equations.gram[c], equations.rhs[c], ridge * equations.ridge[c], current, 0.0 * limits, limits)
        balanced = system.balanced(equations.rises[c], equations.falls[c]) if keeps_balance else system
        columns.append(balanced.solve(is_free))
    return np.stack(columns, axis=-1)


def _solve_intensities(
    sources: Sources, equations: NormalEquations, is_free: NDArray[np.bool_], ridge: float, *, keeps_balance: bool
) -> Shaped[F64, "sources 3"]:
    """Solve for the intensities, which joins the systems of the channels."""
    colors = sources.colors
    gram = np.einsum("sc,cst,tc->st", colors, equations.gram, colors)
    rhs = np.einsum("sc,cs->s", colors, equations.rhs)
    scale = np.einsum("sc,cs->s", np.square(colors), equations.ridge)
    limits = np.full(len(colors), MAX_INTENSITY)
    system = _System(gram, rhs, ridge * scale, sources.intensities, 0.0 * limits, limits)
    if keeps_balance:
        system = system.balanced(np.any(equations.rises, axis=0), np.any(equations.falls, axis=0))
    return system.solve(is_free)[:, None] * colors


@dataclass(frozen=True)
class _System:
    """Minimize xᵀGx − 2gᵀx + Σ ridge (x − current)² over lower ≤ x ≤ upper."""

    gram: F64
    rhs: F64
    ridge: F64
    current: F64
    lower: F64
    upper: F64

    def balanced(self, rises: NDArray[np.bool_], falls: NDArray[np.bool_]) -> _System:
        """Return the system with a ridge of relative changes, and only the changes that are asked for."""
        squares = self.ridge * np.square(self.current)
        energy = squares.sum()
        return replace(
            self,
            ridge=self.ridge * energy / np.maximum(squares, _DIM**2 * energy) if energy > 0.0 else self.ridge,
            lower=np.where(falls, self.lower, self.current),
            upper=np.where(rises, self.upper, self.current),
        )

    def solve(self, is_free: NDArray[np.bool_]) -> Shaped[F64, " sources"]:
        """Return the solution over the free variables."""
        free = np.flatnonzero(is_free & (self.ridge > 0.0) & (self.lower < self.upper))
        strengths = self.current.copy()
        if not len(free) or not self.gram.any():
            return strengths
        fixed = np.setdiff1d(np.arange(len(strengths)), free)
        ridge, current = self.ridge[free], self.current[free]
        system = self.gram[np.ix_(free, free)] + np.diag(ridge)
        wanted = self.rhs[free] - self.gram[np.ix_(free, fixed)] @ self.current[fixed] + ridge * current
        scale = 1.0 / np.sqrt(np.diag(system))  # Jacobi: sources may differ by many orders of magnitude
        system *= scale[:, None] * scale
        factor = cholesky(system + _RELATIVE_ROUNDING * np.eye(len(free)))
        reduced = solve_triangular(factor, wanted * scale, trans="T")
        bounds = self.lower[free] / scale, self.upper[free] / scale
        strengths[free] = lsq_linear(factor, reduced, bounds, method="bvls").x * scale
        return strengths
