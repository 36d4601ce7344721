"""Filter for the light of gather rays: weighted means over neighboring points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.brdf.term import Term

F32 = NDArray[np.float32]


class NeighborFilter(NamedTuple):
    """Filters for the light of gather rays of n points; see `relume.views.gather_filter`.

    Attributes:
        diffuse: weights for diffuse terms, (n, n) sparse; rows sum to one. highlights: for directional terms.
        inverse_distance: mean of 1 / distance over the rays of each point, 1 / scene unit.
    """

    diffuse: csr_array
    highlights: csr_array
    inverse_distance: Shaped[F32, " n"]

    def weights_for(self, term: Term) -> csr_array:
        """Return the weights for a term."""
        return self.diffuse if term.scatters_diffusely else self.highlights


def weights_of_rows(weights: csr_array, start: int, stop: int) -> tuple[csr_array, Shaped[NDArray[np.intp], " k"]]:
    """Find the points whose values points [start, stop) depend on.

    Args:
        weights: of all points, (n, n). start, stop: the points.
    Returns:
        Weights of the points that are found, (stop - start, k), and the points.
    """
    rows = weights[start:stop]
    first = rows.indices.min(initial=weights.shape[1])
    is_neighbor = np.zeros(rows.indices.max(initial=first - 1) + 1 - first, np.bool_)
    is_neighbor[rows.indices - first] = True
    column = np.cumsum(is_neighbor, dtype=np.int32) - 1
    neighbors = first + np.flatnonzero(is_neighbor)
    shape = stop - start, len(neighbors)
    return csr_array((rows.data, column[rows.indices - first], rows.indptr), shape=shape), neighbors


def weights_within(weights: csr_array, is_member: Shaped[NDArray[np.bool_], " n"]) -> csr_array:
    """Return the weights among some points alone; the values of all others become zero.

    Args:
        weights: of all points, (n, n). is_member: of the points.
    """
    member = is_member.astype(np.float32)
    kept = csr_array((weights.data * member[weights.indices], weights.indices, weights.indptr), shape=weights.shape)
    scale = member / np.maximum(kept @ np.ones_like(member), np.float32(1e-6))
    data = kept.data * np.repeat(scale, np.diff(weights.indptr))
    return csr_array((data, weights.indices, weights.indptr), shape=weights.shape)
