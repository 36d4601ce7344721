"""Bases of the free curves of an operator: one curve in wavelets, or a parameter that changes several curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Curve, Term
from relume.lights.spherical_triangles import TriangleLights
from relume.math.daubechies import analysis
from relume.operators.linear_operator import LinearOperator, precompute
from relume.transport.shading_points import ShadingPoints

F64 = NDArray[np.float64]


class EditBasis(Protocol):
    """A basis for edits of a term; hashable, and equal if operators are interchangeable."""

    @property
    def label(self) -> str:
        """Label for users."""
        ...

    @property
    def affected_curves(self) -> tuple[str, ...]:
        """Names of the free curves; all others are fixed."""
        ...

    @property
    def num_columns(self) -> int:
        """Coefficients per channel."""
        ...

    @property
    def is_complete(self) -> bool:
        """True if the basis represents every curve; otherwise images are approximate."""
        ...

    def is_valid_for(self, document: Mapping[str, Any]) -> bool:
        """Return True if the curves of a term document of the same kind lie in the basis."""
        ...

    def coefficients(self, bands: Mapping[str, F64]) -> Shaped[F64, "*batch 3 columns"]:
        """Return the coefficients c of a term's curves, (3, J) each."""
        ...

    def precompute(
        self,
        term: Term,
        bands: Mapping[str, F64],
        lights: TriangleLights,
        receivers: ShadingPoints,
        progress: Callable[[float], None],
        is_canceled: Callable[[], bool],
        bits: int = 32,
    ) -> LinearOperator:
        """Precompute the operator. See `relume.operators.linear_operator.precompute`."""
        ...


@dataclass(frozen=True)
class CurveBasis:
    """Wavelet basis of one curve, for any shape."""

    name: str
    label: str
    num_columns: int

    is_complete = True

    @classmethod
    def from_curve(cls, curve: Curve) -> CurveBasis:
        """Create the basis of a declared curve."""
        return cls(curve.name, curve.label, curve.num_bands)

    @property
    def affected_curves(self) -> tuple[str, ...]:
        """Name of the curve."""
        return (self.name,)

    def is_valid_for(self, document: Mapping[str, Any]) -> bool:
        """Return True: the basis represents any shape."""
        return True

    def coefficients(self, bands: Mapping[str, F64]) -> Shaped[F64, "*batch 3 columns"]:
        """Return the wavelet coefficients."""
        return analysis(bands[self.name])

    def precompute(
        self,
        term: Term,
        bands: Mapping[str, F64],
        lights: TriangleLights,
        receivers: ShadingPoints,
        progress: Callable[[float], None],
        is_canceled: Callable[[], bool],
        bits: int = 32,
    ) -> LinearOperator:
        """See `relume.operators.linear_operator.precompute`."""
        return precompute(term, bands, self.name, lights, receivers, progress, is_canceled, bits)
