"""Representation of each term of a material by free cameras, for users: functions and error (Mahajan 2008)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import compress
from typing import Any, Literal, NamedTuple

from relume.live.free_camera.basis.highlight_lobes import is_representable, terms_in_lobe
from relume.live.free_camera.basis.material_tables import needed_degrees
from relume.live.free_camera.basis.outgoing_coefficients import white_coefficients
from relume.live.free_camera.lobe_terms import has_traced_lobe
from relume.math.zernike import DEGREES, NUM_FUNCTIONS, degree_of, num_functions

BOUND = 0.05

DrawnBy = Literal["functions", "lights", "rays"]


class FactorizationError(NamedTuple):
    """Representation of a term for the free camera.

    Attributes:
        functions: number of basis functions in use, of `available`.
        residual: their cosine-weighted RMS error, relative to the term's RMS.
        required_functions: number of functions with a residual of at most `BOUND`; None if all are not enough.
        drawn_by: `functions` all light; `lights` the environment by the term's shape, summed over visible lights, and
            other light by functions; `rays` all light by rays in the lobe. Browsers look up a blurred environment
            instead of rays.
    """

    functions: int
    available: int
    residual: float
    required_functions: int | None
    drawn_by: DrawnBy


def factorization_errors(
    terms: Sequence[Mapping[str, Any]], basis_functions: int | None = None
) -> list[FactorizationError]:
    """Return the representation of each term of a material.

    Args:
        terms: of a complete look. basis_functions: number that the look asks for; None: as many as each term needs.
    """
    drawn_by: list[DrawnBy] = ["functions"] * len(terms) if basis_functions is not None else _drawn_by(terms)
    return [_error(term, how, basis_functions) for term, how in zip(terms, drawn_by, strict=True)]


def _error(term: Mapping[str, Any], drawn_by: DrawnBy, basis_functions: int | None) -> FactorizationError:
    coefficients = white_coefficients(term)
    residuals = coefficients.residual_by_degree
    if basis_functions is None:
        degree = int(needed_degrees(coefficients.table[None], DEGREES)[0])
    else:
        degree = degree_of(basis_functions)
    enough = next((num_functions(n) for n, residual in enumerate(residuals) if residual <= BOUND), None)
    return FactorizationError(num_functions(degree), NUM_FUNCTIONS, residuals[degree], enough, drawn_by)


def _drawn_by(terms: Sequence[Mapping[str, Any]]) -> list[DrawnBy]:
    is_traced = [has_traced_lobe([term]) for term in terms]
    stored = [term for term, traced in zip(terms, is_traced, strict=True) if not traced]
    is_in_lobe = terms_in_lobe([white_coefficients(term) for term in stored])
    highlight: DrawnBy = "functions" if is_representable([*compress(stored, is_in_lobe)]) else "lights"
    in_lobe = iter(is_in_lobe)
    return ["rays" if traced else highlight if next(in_lobe) else "functions" for traced in is_traced]
