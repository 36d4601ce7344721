"""What places of a BTF send, place by place in plain NumPy: for brute force, and the oracle of kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.btf.eigen import EigenBtf
from relume.btf.parallax import height_seen_numpy, slants
from relume.btf.rings import taps_numpy

F64 = NDArray[np.float64]

_BESIDE = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])


def seen_numpy(found: EigenBtf, places: F64, wo: F64) -> F64:
    """The mean over places of what they send to an eye of light from each side in which the BTF is known.

    Args:
        found: the BTF. wo: to the eye, in the texture's frame, unit. (3,)
        places: column and row, in texels of the finest level, from the middle of the first. (n, 2)
    Returns:
        (L, 3) float64, the cosine of the light in it
    """
    size, sides = np.array(found.size[::-1]), slants(found.rings)
    slant = wo[:2] / max(wo[2], np.hypot(wo[0], wo[1]) / np.tan(found.rings.theta[-1]))
    height = np.array([height_seen_numpy(found.height, (one + 0.5) / size, slant) for one in places])
    view, of_view, _ = taps_numpy(found.rings, wo[None])
    seen = np.zeros((found.rings.num_directions, 3))
    for side, share in zip(view[0], of_view[0], strict=True):
        at = places + height[:, None] * (slant - sides[side]) * [1, -1] * size
        first = np.floor(at).astype(int)
        near = np.abs(1 - _BESIDE - (at - first)[:, None]).prod(axis=2) / len(places)
        column, row = np.moveaxis((first[:, None] + _BESIDE) % size, 2, 0)
        seen += share * found.sum_from(side, (row * size[0] + column).ravel(), near.ravel())
    return seen


def sent_numpy(found: EigenBtf, seen: F64, wi: F64) -> F64:
    """What is sent of light from some directions, one unit of irradiance across each.

    Args:
        found: the BTF. seen: from `seen_numpy`. wi: in the texture's frame, unit. (m, 3)
    Returns:
        (m, 3) float64
    """
    light, of_light, left = taps_numpy(found.rings, wi)
    return np.asarray(np.einsum("mk,m,mkc->mc", of_light, left, seen[light]))
