"""How points share what their gather rays bring: weighted means of neighbours, taken once or several times."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.brdf.term import Term


class Weights(NamedTuple):
    """Weights of n points for each other.

    Attributes:
        matrix: rows sum to one. (n, n) sparse, float32
        times: how often what each point has is replaced by the weighted mean.
    """

    matrix: Any
    times: int

    def rings(self, start: int, stop: int) -> tuple[list[Any], NDArray[np.intp]]:
        """Find what points [start, stop) need of others.

        Returns:
            Matrices that are to be multiplied with what the points have, the last one first; and those points.
        """
        wanted, found = np.arange(start, stop), list[Any]()
        place, is_among = np.empty(self.matrix.shape[1], np.int32), np.zeros(self.matrix.shape[1], np.bool_)
        for _ in range(self.times):
            rows = self.matrix[wanted]
            is_among[rows.indices] = True
            among = np.flatnonzero(is_among)
            place[among] = np.arange(len(among))
            found.append(csr_array((rows.data, place[rows.indices], rows.indptr), shape=(len(wanted), len(among))))
            is_among[among], wanted = False, among
        return found, wanted


class Sharing(NamedTuple):
    """How points share what their gather rays bring; see `relume.views.sharing`.

    Attributes:
        even: of what is scattered evenly. highlights: of what is sent about one direction.
    """

    even: Weights
    highlights: Weights

    def of(self, term: Term) -> Weights:
        """Those of what a term makes of the rays' light."""
        return self.even if term.scatters_evenly else self.highlights
