"""What the in-basis makes of a term, in numbers that people can be told (Mahajan 2008, section 3.3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from relume.live.free_camera.basis.highlight_lobes import is_narrow
from relume.live.free_camera.basis.outgoing_coefficients import white_coefficients
from relume.math.zernike import NUM_FUNCTIONS, num_functions

BOUND = 0.05


class FactorizationError(NamedTuple):
    """How a term is sent in moving views.

    Attributes:
        functions: K, of the in-basis. residual: what these miss of the term, cosine-weighted RMS over its own.
        required_functions: how many functions miss at most `BOUND`; None where K do not.
        is_mirror: it is sent as a blurred mirror instead, since K functions miss too much.
    """

    functions: int
    residual: float
    required_functions: int | None
    is_mirror: bool


def factorization_error(term_document: Mapping[str, Any]) -> FactorizationError:
    """Of one term of a complete look."""
    coefficients = white_coefficients(term_document)
    residuals = coefficients.residual_by_degree
    needed = next((num_functions(degree) for degree, residual in enumerate(residuals) if residual <= BOUND), None)
    return FactorizationError(NUM_FUNCTIONS, residuals[-1], needed, is_narrow(coefficients))
