"""Factorization error of a term in the hemispherical basis, for users (Mahajan 2008, section 3.3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from relume.live.free_camera.basis.highlight_lobes import is_narrow
from relume.live.free_camera.basis.outgoing_coefficients import white_coefficients
from relume.math.zernike import NUM_FUNCTIONS, num_functions

BOUND = 0.05


class FactorizationError(NamedTuple):
    """Representation of a term for the free camera.

    Attributes:
        functions: K, size of the basis. residual: cosine-weighted RMS error of the basis, relative to the term's RMS.
        required_functions: number of functions with a residual of at most `BOUND`; None if K are not enough.
        is_mirror: the term is rendered as a lobe instead, since the residual of K functions is too large.
    """

    functions: int
    residual: float
    required_functions: int | None
    is_mirror: bool


def factorization_error(term_document: Mapping[str, Any]) -> FactorizationError:
    """Return the factorization error of one term of a complete look."""
    coefficients = white_coefficients(term_document)
    residuals = coefficients.residual_by_degree
    needed = next((num_functions(degree) for degree, residual in enumerate(residuals) if residual <= BOUND), None)
    return FactorizationError(NUM_FUNCTIONS, residuals[-1], needed, is_narrow(coefficients))
