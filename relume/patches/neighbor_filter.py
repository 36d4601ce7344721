"""Filter for the light of gather rays: weighted means over neighboring points, in one or several passes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.brdf.term import Term


class FilterWeights(NamedTuple):
    """Filter weights of n points.

    Attributes:
        matrix: rows sum to one. (n, n) sparse, float32
        num_passes: number of times that values are replaced by their weighted means.
    """

    matrix: Any
    num_passes: int

    def find_dependencies(self, start: int, stop: int) -> tuple[list[Any], NDArray[np.intp]]:
        """Find the points whose values points [start, stop) depend on.

        Returns:
            Matrices to multiply with these points' values, the last one first; and the points.
        """
        needed, matrices = np.arange(start, stop), list[Any]()
        compact_index, is_neighbor = np.empty(self.matrix.shape[1], np.int32), np.zeros(self.matrix.shape[1], np.bool_)
        for _ in range(self.num_passes):
            rows = self.matrix[needed]
            is_neighbor[rows.indices] = True
            neighbors = np.flatnonzero(is_neighbor)
            compact_index[neighbors] = np.arange(len(neighbors))
            matrices.append(
                csr_array((rows.data, compact_index[rows.indices], rows.indptr), shape=(len(needed), len(neighbors)))
            )
            is_neighbor[neighbors], needed = False, neighbors
        return matrices, needed

    def within(self, is_member: Shaped[NDArray[np.bool_], " n"]) -> FilterWeights:
        """Return the filter among some points alone; the values of all others become zero."""
        matrix, member = self.matrix, is_member.astype(np.float32)
        kept = csr_array((matrix.data * member[matrix.indices], matrix.indices, matrix.indptr), shape=matrix.shape)
        scale = member / np.maximum(kept @ np.ones_like(member), np.float32(1e-6))
        data = kept.data * np.repeat(scale, np.diff(matrix.indptr))
        return FilterWeights(csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape), self.num_passes)


class NeighborFilter(NamedTuple):
    """Filters for the light of gather rays; see `relume.views.gather_filter`.

    Attributes:
        diffuse: weights for diffuse terms. highlights: weights for directional terms.
    """

    diffuse: FilterWeights
    highlights: FilterWeights

    def weights_for(self, term: Term) -> FilterWeights:
        """Return the weights for a term."""
        return self.diffuse if term.scatters_diffusely else self.highlights
