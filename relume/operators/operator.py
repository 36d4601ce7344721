"""Interface of the operators of a term, of all samples of an image or of a subset."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class Operator(ABC):
    """The linear map from coefficients to the image of one term.

    Attributes:
        is_whole: contains all samples, so that its sums are images; otherwise they are changes of an image.
        is_exact: its sums equal a full evaluation up to rounding.
        importance: norm of each column over all samples.
    """

    is_whole: ClassVar[bool]
    is_exact: ClassVar[bool]
    importance: Shaped[F64, "*levels 3 J"]

    @property
    @abstractmethod
    def num_bytes(self) -> int:
        """Memory in use."""

    @abstractmethod
    def add(self, change: Shaped[F64, "*levels 3 J"], image: Shaped[F32, "tiles 3 samples"]) -> None:
        """Add Σ_j Δc_j T_j to an image; see `write_image`."""

    @abstractmethod
    def columns_at(self, sample: int) -> Shaped[F64, "3 J"]:
        """Return the column values at one sample."""

    def write_image(self, coefficients: Shaped[F64, "*levels 3 J"], image: Shaped[F32, "tiles 3 samples"]) -> None:
        """Overwrite an image with Σ_j c_j T_j, for the coefficients c of all columns."""
        image[:] = 0
        self.add(coefficients, image)
