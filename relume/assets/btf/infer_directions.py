"""Inference of a direction grid from the unordered directions of a file."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import MAX_DIRECTIONS, DirectionGrid, directions, make_direction_grid
from relume.core.errors import MaterialError
from relume.math.polar import polar

F64 = NDArray[np.float64]

_MIN_RING_DISTANCE = 0.5  # degrees of θ between rings
_MAX_DEVIATION = 1.5  # degrees from a direction to its grid direction: names have whole degrees
_MIN_SHIFT = 1e-3  # of a step; smaller shifts are rounded to zero


def infer_rings(
    theta: Shaped[F64, " n"], phi: Shaped[F64, " n"]
) -> tuple[DirectionGrid, Shaped[NDArray[np.intp], " n"]]:
    """Fit rings about the normal to directions; each ring may start at its own φ.

    Args:
        theta, phi: θ and φ of each direction, degrees.
    Returns:
        The grid; and for each of its directions, the index into `theta` and `phi`.
    Raises:
        MaterialError: directions are not above the horizon, too many, or not uniformly on rings.
    """
    if len(theta) > MAX_DIRECTIONS:
        raise MaterialError(f"the BTF has {len(theta):,} directions, the limit is {MAX_DIRECTIONS}; leave some out")
    invalid = np.flatnonzero(~((theta >= 0) & (theta < 90) & np.isfinite(phi)))
    if len(invalid):
        raise missing_direction(theta[invalid[0]], phi[invalid[0]])
    by_theta = np.argsort(theta, kind="stable")
    ring_members = np.split(by_theta, np.flatnonzero(np.diff(theta[by_theta]) > _MIN_RING_DISTANCE) + 1)
    shift = [_ring_shift(phi[ring]) for ring in ring_members]
    mean = [float(theta[ring].mean()) for ring in ring_members]
    if len(ring_members[0]) == 1 and mean[0] <= _MIN_RING_DISTANCE:
        mean[0] = 0.0
    grid = make_direction_grid(
        [(ring_theta, len(ring)) for ring_theta, ring in zip(mean, ring_members, strict=True)], shift
    )
    order = np.concatenate(
        [_order_ring(ring, phi, ring_shift) for ring, ring_shift in zip(ring_members, shift, strict=True)]
    )
    max_deviation = np.abs(polar(np.radians(theta[order]), np.radians(phi[order])) - directions(grid)).max()
    if len(np.unique(order)) != len(theta) or max_deviation > np.radians(_MAX_DEVIATION):
        raise MaterialError("the directions of the BTF are not uniformly spaced on rings about the normal; resample it")
    return grid, order


def missing_direction(theta: float, phi: float) -> MaterialError:
    """Return the error for a direction, in degrees, that is not above the horizon."""
    return MaterialError(
        f"the BTF has a direction at θ = {theta:.4g}°, φ = {phi:.4g}°, which is not above the horizon; leave out the "
        "images with it"
    )


def _ring_shift(phi: F64) -> float:
    """Shift of a ring, in steps: the mean over its directions. [0, 1)"""
    if len(phi) == 1:
        return 0.0
    offset = float(np.angle(np.exp(1j * np.radians(phi) * len(phi)).mean()) / (2 * np.pi) % 1.0)
    return 0.0 if min(offset, 1 - offset) < _MIN_SHIFT else offset


def _order_ring(ring: NDArray[np.intp], phi: F64, shift: float) -> NDArray[np.intp]:
    """Indices of a ring's directions in order of φ; some repeat if they are not uniformly spaced."""
    position = np.rint(phi[ring] * len(ring) / 360 - shift).astype(np.int64) % len(ring)
    order = np.full(len(ring), ring[0])
    order[position] = ring
    return order
