"""What a look wants of one term of one material, read once from its document."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.brdf.term import Term

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Wanted:
    """A term as it should be shown.

    Attributes:
        document: of the term in a look. term: the declaration of its model, fixed parameters put in.
        model: what tells it from other models.
        bands: of each curve that depends on where light comes from. (3, J) float64 each
        outgoing: product of the curves of the outgoing angle, per sample. (3, samples) float32, or None for 1
    """

    document: Mapping[str, Any]
    term: Term
    model: Hashable
    bands: Mapping[str, F64]
    outgoing: F32 | None

    @classmethod
    def of(cls, document: Mapping[str, Any], theta_o: F64) -> Wanted:
        """Read a term document. theta_o: angle at which each sample is seen, radians. (samples,)"""
        declared = TERMS[document["model"]]
        term = declared.settled(document)
        bands = {curve.name: curve_bands(document, curve) for curve in term.curves if not curve.outgoing}
        values = [curve_values(document, curve, theta_o) for curve in term.curves if curve.outgoing]
        outgoing = np.asarray(np.prod(values, axis=0), np.float32) if values else None
        return cls(document, term, (document["model"], declared.fixed_values(document)), bands, outgoing)
