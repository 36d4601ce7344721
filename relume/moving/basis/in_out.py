"""What the in-basis makes of a term, in numbers that people can be told (Mahajan 2008, section 3.3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from relume.basis.zernike import NUM_FUNCTIONS, num_functions
from relume.moving.basis.lobes import is_narrow
from relume.moving.basis.out_factors import of_white

BOUND = 0.05


class InOut(NamedTuple):
    """How a term is sent in moving views.

    Attributes:
        functions: K, of the in-basis. missed: what these miss of the term, cosine-weighted RMS over its own.
        needed: how many functions miss at most `BOUND`; None where K do not.
        is_mirror: it is sent as a blurred mirror instead, since K functions miss too much.
    """

    functions: int
    missed: float
    needed: int | None
    is_mirror: bool


def in_out(term_document: Mapping[str, Any]) -> InOut:
    """Of one term of a complete look."""
    known = of_white(term_document)
    missed = known.missed_by_degree
    needed = next((num_functions(degree) for degree, share in enumerate(missed) if share <= BOUND), None)
    return InOut(NUM_FUNCTIONS, missed[-1], needed, is_narrow(known))
