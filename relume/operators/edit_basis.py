"""What an operator leaves free: one curve in its wavelet basis, or whatever moves several of them together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Curve, Term
from relume.lights.spherical_triangles import TriangleLights
from relume.math.daubechies import analysis
from relume.operators.linear_operator import LinearOperator, precompute
from relume.operators.quantized import QuantizedOperator
from relume.transport.shading_points import ShadingPoints

F64 = NDArray[np.float64]


class EditBasis(Protocol):
    """A direction in which a term is free; hashable, and equal where its operators are interchangeable."""

    @property
    def label(self) -> str:
        """What people read."""
        ...

    @property
    def affected_curves(self) -> tuple[str, ...]:
        """Names of the curves that are free, all others being dormant."""
        ...

    @property
    def num_columns(self) -> int:
        """Coefficients a channel."""
        ...

    @property
    def is_complete(self) -> bool:
        """Whether every curve can be said in it; else what it shows is near the look, not the look."""
        ...

    def is_valid_for(self, document: Mapping[str, Any]) -> bool:
        """Whether the curves of a term document of the same kind lie along it."""
        ...

    def coefficients(self, bands: Mapping[str, F64]) -> F64:
        """c of a term's curves, (3, J) each. (3, num_columns)"""
        ...

    def precompute(
        self,
        term: Term,
        bands: Mapping[str, F64],
        lights: TriangleLights,
        receivers: ShadingPoints,
        progress: Callable[[float], None],
        is_canceled: Callable[[], bool],
        *,
        is_quantized: bool = False,
    ) -> LinearOperator | QuantizedOperator:
        """The operator. See `relume.operators.linear_operator.precompute`."""
        ...


@dataclass(frozen=True)
class CurveBasis:
    """One curve, free to take any shape."""

    name: str
    label: str
    num_columns: int

    is_complete = True

    @classmethod
    def from_curve(cls, curve: Curve) -> CurveBasis:
        """Along a declared curve."""
        return cls(curve.name, curve.label, curve.num_bands)

    @property
    def affected_curves(self) -> tuple[str, ...]:
        """The curve alone."""
        return (self.name,)

    def is_valid_for(self, document: Mapping[str, Any]) -> bool:
        """Any shape is among its own."""
        return True

    def coefficients(self, bands: Mapping[str, F64]) -> F64:
        """Of the wavelets."""
        return analysis(bands[self.name])

    def precompute(
        self,
        term: Term,
        bands: Mapping[str, F64],
        lights: TriangleLights,
        receivers: ShadingPoints,
        progress: Callable[[float], None],
        is_canceled: Callable[[], bool],
        *,
        is_quantized: bool = False,
    ) -> LinearOperator | QuantizedOperator:
        """See `relume.operators.linear_operator.precompute`."""
        return precompute(term, bands, self.name, lights, receivers, progress, is_canceled, is_quantized=is_quantized)
