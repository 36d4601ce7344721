"""Directions that a file tells, one after another, as rings: which of them is which."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import MAX_DIRECTIONS, DirectionGrid, directions, make_direction_grid, polar
from relume.core.errors import MaterialError

F64 = NDArray[np.float64]

_MIN_RING_DISTANCE = 0.5  # degrees of θ from one ring to the next, at least
_MAX_DEVIATION = 1.5  # degrees that directions may be from where the ring has them: names have whole degrees
_MIN_SHIFT = 1e-3  # of a step: rings that begin so near φ = 0 begin there


def infer_rings(theta: F64, phi: F64) -> tuple[DirectionGrid, NDArray[np.intp]]:
    """Put directions onto rings about the normal; each ring may begin at a φ of its own.

    Args:
        theta, phi: of each direction, degrees. (n,) each
    Returns:
        The rings; of each of their directions, its number among those that were given. (n,)
    Raises:
        MaterialError: they are not above the horizon, too many, or not evenly on rings.
    """
    if len(theta) > MAX_DIRECTIONS:
        raise MaterialError(
            f"the BTF has {len(theta):,} directions; at most {MAX_DIRECTIONS} can be kept, leave some out"
        )
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
        raise MaterialError("the directions of the BTF are not evenly on rings about the normal; resample it to such")
    return grid, order


def missing_direction(theta: float, phi: float) -> MaterialError:
    """What is wrong with a direction, in degrees, that is not above the horizon."""
    return MaterialError(
        f"a direction of the BTF lies at θ = {theta:.4g}°, φ = {phi:.4g}°: at or below the horizon, or nowhere; leave "
        "out what is seen or lit from there"
    )


def _ring_shift(phi: F64) -> float:
    """Where a ring begins, in steps: the mean of where each of its directions says. [0, 1)"""
    if len(phi) == 1:
        return 0.0
    offset = float(np.angle(np.exp(1j * np.radians(phi) * len(phi)).mean()) / (2 * np.pi) % 1.0)
    return 0.0 if min(offset, 1 - offset) < _MIN_SHIFT else offset


def _order_ring(ring: NDArray[np.intp], phi: F64, shift: float) -> NDArray[np.intp]:
    """The directions of a ring, given as `ring`, from its beginning on; some twice where they are not evenly on it."""
    position = np.rint(phi[ring] * len(ring) / 360 - shift).astype(np.int64) % len(ring)
    order = np.full(len(ring), ring[0])
    order[position] = ring
    return order
