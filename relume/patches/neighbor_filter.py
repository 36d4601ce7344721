"""How points share what their gather rays bring: weighted means of neighbours, taken once or several times."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.brdf.term import Term


class FilterWeights(NamedTuple):
    """Weights of n points for each other.

    Attributes:
        matrix: rows sum to one. (n, n) sparse, float32
        num_passes: how often what each point has is replaced by the weighted mean.
    """

    matrix: Any
    num_passes: int

    def find_dependencies(self, start: int, stop: int) -> tuple[list[Any], NDArray[np.intp]]:
        """Find what points [start, stop) need of others.

        Returns:
            Matrices that are to be multiplied with what the points have, the last one first; and those points.
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


class NeighborFilter(NamedTuple):
    """How points share what their gather rays bring; see `relume.views.gather_filter`.

    Attributes:
        diffuse: of what is scattered evenly. highlights: of what is sent about one direction.
    """

    diffuse: FilterWeights
    highlights: FilterWeights

    def weights_for(self, term: Term) -> FilterWeights:
        """Those of what a term makes of the rays' light."""
        return self.diffuse if term.scatters_diffusely else self.highlights
