"""What every operator of a term does, whether it was made of all samples of a picture or of some of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class Operator(ABC):
    """The linear map from coefficients to the image of one term.

    Attributes:
        is_whole: made of all samples: its sums are images; else they only say how an image changes.
        is_exact: its sums are those that a full evaluation gives, to rounding.
        importance: length of each column over all samples; what a coefficient moves in the picture. (3, J) float64,
            (L, 3, J) over those of each level
    """

    is_whole: ClassVar[bool]
    is_exact: ClassVar[bool]
    importance: F64

    @property
    @abstractmethod
    def num_bytes(self) -> int:
        """Memory it holds."""

    @abstractmethod
    def add(self, change: F64, image: F32) -> None:
        """Add Σ_j Δc_j T_j to an image; see `write_image`."""

    @abstractmethod
    def columns_at(self, sample: int) -> F64:
        """What each coefficient gives to one sample. (3, J)"""

    def write_image(self, coefficients: F64, image: F32) -> None:
        """Write Σ_j c_j T_j over an image.

        Args:
            coefficients: c of all columns. (3, J), or (L, 3, J). image: (tiles, 3, samples) float32, overwritten
        """
        image[:] = 0
        self.add(coefficients, image)
