"""Directions that a file tells, one after another, as rings: which of them is which."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.btf.rings import MOST_DIRECTIONS, Rings, directions, polar, rings_of
from relume.errors import MaterialError

F64 = NDArray[np.float64]

_APART = 0.5  # degrees of θ from one ring to the next, at least
_OFF = 1.5  # degrees that directions may be from where the ring has them: names have whole degrees
_NOWHERE = 1e-3  # of a step: rings that begin so near φ = 0 begin there


def found_rings(theta: F64, phi: F64) -> tuple[Rings, NDArray[np.intp]]:
    """Put directions onto rings about the normal; each ring may begin at a φ of its own.

    Args:
        theta, phi: of each direction, degrees. (n,) each
    Returns:
        The rings; of each of their directions, its number among those that were given. (n,)
    Raises:
        MaterialError: they are not above the horizon, too many, or not evenly on rings.
    """
    if len(theta) > MOST_DIRECTIONS:
        raise MaterialError(
            f"the BTF has {len(theta):,} directions; at most {MOST_DIRECTIONS} can be kept, leave some out"
        )
    wrong = np.flatnonzero(~((theta >= 0) & (theta < 90) & np.isfinite(phi)))
    if len(wrong):
        raise nowhere(theta[wrong[0]], phi[wrong[0]])
    rising = np.argsort(theta, kind="stable")
    of_rings = np.split(rising, np.flatnonzero(np.diff(theta[rising]) > _APART) + 1)
    shift = [_shift(phi[ring]) for ring in of_rings]
    mean = [float(theta[ring].mean()) for ring in of_rings]
    if len(of_rings[0]) == 1 and mean[0] <= _APART:
        mean[0] = 0.0
    rings = rings_of([(at, len(ring)) for at, ring in zip(mean, of_rings, strict=True)], shift)
    order = np.concatenate([_placed(ring, phi, turned) for ring, turned in zip(of_rings, shift, strict=True)])
    away = np.abs(polar(np.radians(theta[order]), np.radians(phi[order])) - directions(rings)).max()
    if len(np.unique(order)) != len(theta) or away > np.radians(_OFF):
        raise MaterialError("the directions of the BTF are not evenly on rings about the normal; resample it to such")
    return rings, order


def nowhere(theta: float, phi: float) -> MaterialError:
    """What is wrong with a direction, in degrees, that is not above the horizon."""
    return MaterialError(
        f"a direction of the BTF lies at θ = {theta:.4g}°, φ = {phi:.4g}°: at or below the horizon, or nowhere; leave "
        "out what is seen or lit from there"
    )


def _shift(phi: F64) -> float:
    """Where a ring begins, in steps: the mean of where each of its directions says. [0, 1)"""
    if len(phi) == 1:
        return 0.0
    turn = float(np.angle(np.exp(1j * np.radians(phi) * len(phi)).mean()) / (2 * np.pi) % 1.0)
    return 0.0 if min(turn, 1 - turn) < _NOWHERE else turn


def _placed(ring: NDArray[np.intp], phi: F64, shift: float) -> NDArray[np.intp]:
    """The directions of a ring, given as `ring`, from its beginning on; some twice where they are not evenly on it."""
    place = np.rint(phi[ring] * len(ring) / 360 - shift).astype(np.int64) % len(ring)
    order = np.full(len(ring), ring[0])
    order[place] = ring
    return order
