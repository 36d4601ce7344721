"""Target of one term of one material, parsed from its document."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.registry import TERMS
from relume.brdf.roughness_levels import NO_LEVELS, RoughnessLevels, level_bands, level_values
from relume.brdf.term import Term

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True)
class TargetTerm:
    """The target state of a term.

    Attributes:
        document: document of the term in a look. term: the declaration of its model with its fixed parameters.
        model: identifies the model and these parameters.
        bands: bands of each curve that depends on the incident direction. (3, J) float64 each, or (L, 3, J) if it
            differs between roughness levels
        view_factor: product of the curves of the outgoing angle, per sample; None for 1.
    """

    document: Mapping[str, Any]
    term: Term
    model: Hashable
    bands: Mapping[str, F64]
    view_factor: Shaped[F32, "3 samples"] | None

    @classmethod
    def from_document(
        cls, document: Mapping[str, Any], theta_o: Callable[[], F64], levels: RoughnessLevels = NO_LEVELS
    ) -> TargetTerm:
        """Parse a term document.

        Args:
            theta_o: returns the outgoing angle of each sample, radians, (samples,); called only if a curve needs it.
            levels: roughness levels of the samples.
        """
        declared = TERMS[document["model"]]
        term = declared.normalized(document)
        bands = {c.name: level_bands(document, c, levels) for c in term.curves if not c.depends_on_view}
        values = [
            level_values(document, c, theta_o(), levels) for c in term.active_curves(document) if c.depends_on_view
        ]
        view_factor = np.asarray(np.prod(values, axis=0), np.float32) if values else None
        return cls(document, term, (document["model"], declared.fixed_values(document)), bands, view_factor)
