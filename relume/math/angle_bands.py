"""J equal angle bands over [0, π/2], and averages over them by quadrature. Every basis is a matrix on these bands."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F64 = NDArray[np.float64]

MAX_ANGLE = math.pi / 2
_ORDER = 12
# Highlights can be a tenth as wide as the first band, and masking and Fresnel terms change as late in the last band.
# Both bands are subdivided toward their outer ends: averages are exact to 1e-6 over every parameter's range.
_CUTS = (1 / 256, 1 / 64, 1 / 16, 1 / 4)


def band_edges(num_bands: int) -> Shaped[F64, " edges"]:
    """Return the J + 1 edges of the bands, in radians."""
    return np.linspace(0.0, MAX_ANGLE, num_bands + 1)


@lru_cache(maxsize=16)
def _quadrature(num_bands: int) -> tuple[F64, F64, NDArray[np.intp]]:
    """Composite Gauss-Legendre rule: nodes and weights (panels, order), and the first panel of each band (J,)."""
    edges = band_edges(num_bands)
    cuts = np.array(_CUTS) * edges[1]
    panels = np.unique(np.concatenate([edges, cuts, MAX_ANGLE - cuts]))
    x, w = np.polynomial.legendre.leggauss(_ORDER)
    half = 0.5 * np.diff(panels)[:, None]
    nodes = panels[:-1, None] + half * (1.0 + x)
    weights = half * w * (num_bands / MAX_ANGLE)
    return nodes, weights, np.searchsorted(panels, edges[:-1])


def band_averages(
    function: Callable[[F64], F64], num_bands: int, *, solid_angle_weighted: bool = False
) -> Shaped[F64, " J"]:
    """Mean of a function over each band; point samples would make highlights pop (appendix B, Ben-Artzi 2006).

    Args:
        function: maps γ in radians (n,) to f(γ) (n,).
        num_bands: J.
        solid_angle_weighted: weight angles by their solid angle, approximated by γ within a band: a lobe narrower than
            the first band keeps its energy and becomes as wide as the band.
    """
    nodes, weights, first_panel = _quadrature(num_bands)
    values = function(nodes.ravel()).reshape(nodes.shape)
    if solid_angle_weighted:
        centers = (np.arange(num_bands) + 0.5) * (MAX_ANGLE / num_bands)
        weights = weights * nodes
        return np.asarray(np.add.reduceat(np.einsum("pn,pn->p", values, weights), first_panel) / centers)
    return np.asarray(np.add.reduceat(np.einsum("pn,pn->p", values, weights), first_panel))
