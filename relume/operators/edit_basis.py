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
from relume.math.daubechies import analysis, forward
from relume.operators.linear_operator import LinearOperator, level_bounds, pack_columns
from relume.transport.roughness_ranges import contract_levels, project_levels, without_free_curves
from relume.transport.shading_points import ShadingPoints
from relume.transport.split_light import SplitLight

F32 = NDArray[np.float32]
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

    def columns(
        self, term: Term, bands: Mapping[str, F64], lights: TriangleLights, receivers: ShadingPoints
    ) -> Callable[[int, int], Shaped[F32, "3 samples columns"]]:
        """Return a function that computes the operator's columns at samples [start, stop), called in several threads.

        Args:
            bands: bands of all the term's curves, (3, J) each, or (L, 3, J) if one depends on the level; values of
                the affected ones do not matter.
            lights, receivers: incident light, and its receivers.
        """
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

    def columns(
        self, term: Term, bands: Mapping[str, F64], lights: TriangleLights, receivers: ShadingPoints
    ) -> Callable[[int, int], Shaped[F32, "3 samples columns"]]:
        """Return the columns T_D4 = T_box · S, with S the orthonormal Daubechies-4 synthesis (appendix B, Ben-Artzi
        2006). See `EditBasis`."""
        contractions = contract_levels(term, without_free_curves(bands, [self.name]), self.name)

        def columns(start: int, stop: int) -> F32:
            projected = project_levels(term, contractions, lights, receivers, start, stop)
            coefficients = np.ascontiguousarray(projected.transpose(2, 0, 1))
            forward(coefficients.reshape(-1, coefficients.shape[2]))
            return coefficients

        return columns


def precompute(
    basis: EditBasis,
    term: Term,
    bands: Mapping[str, F64],
    lights: TriangleLights,
    receivers: ShadingPoints,
    progress: Callable[[float], None],
    is_canceled: Callable[[], bool],
    bits: int = 32,
    split: SplitLight | None = None,
) -> LinearOperator:
    """Precompute the operator of a term along a basis, at all receivers.

    Args:
        basis: the free coefficients. term, bands, lights, receivers: see `EditBasis.columns`.
        progress: called with the completed fraction. is_canceled: polled. bits: see `Compression`.
        split: light at receivers that are split into points.
    Raises:
        CancelledError: `is_canceled` returned True.
    """
    bounds = level_bounds(receivers, bands, basis.affected_curves)
    columns = basis.columns(term, bands, lights, receivers)
    if split is not None:
        columns = split.averaged(columns, basis.columns(term, bands, split.lights, split.points))
    return pack_columns(columns, basis.num_columns, receivers, bounds, progress, is_canceled, bits)
