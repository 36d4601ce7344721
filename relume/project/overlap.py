"""How much of a triangle lies in each band of an angle: Ben-Artzi 2006, appendix A.

Only the angle at the three corners is needed: where the angle is linear over the triangle, the area below a value y
grows quadratically from the smallest corner to the middle one and from there to the largest. What lies beyond the last
band counts to it: angles are clamped to its end.
"""

from __future__ import annotations

import numba as nb
import numpy as np

_ONE = np.float32(1)
# corners closer than this, in bands, count as one: the formula divides by their distance
_CLOSE = np.float32(1e-4)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def overlap_of(a, b, c):  # type: ignore[no-untyped-def]
    """Compute what the share below an angle needs of a triangle, whose corners have the angles a, b, c in bands.

    Returns:
        Smallest, middle and largest angle of corners in any order; 1/((b−a)(c−a)) and 1/((c−b)(c−a)) of the sorted.
    """
    smaller, larger = min(a, b), max(a, b)
    low, middle, high = min(smaller, c), max(smaller, min(larger, c)), max(larger, c)
    rising, falling = max(middle - low, _CLOSE), max(high - middle, _CLOSE)
    width = rising + falling
    return low, middle, high, _ONE / (rising * width), _ONE / (falling * width)
