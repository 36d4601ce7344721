"""The one state of a term's image: what it shows, how truly, and from which exact image it can go on."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from relume.operators.edit_basis import EditBasis
from relume.operators.operator import Operator
from relume.picture.fidelity import Fidelity
from relume.picture.light import Light
from relume.views.view import Tile

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-24  # of float32

# Share of an image's length that float32 sums may have left in it where it is called exact.
MOST_IN_EXACT = 2.0**-16
_COLUMNS_A_SUM = 4  # that `relume.operators.stream` adds to an image at once


@dataclass(frozen=True, eq=False)
class Shown:
    """What an image of one term shows, before colour, texture and outgoing curves.

    The image belongs to the picture's own thread: steps are added in place, and nothing else keeps it but its anchor.

    Attributes:
        image: Σ_j c_j T_j. (tiles, 3, samples) float32
        fidelity: how truly it shows `bands` under `light`.
        bands: of each curve, (3, J) float64; not a number where only the most important coefficients have been moved.
        light: what arrives; None where nothing is shown.
        basis: what the operator in use leaves free. coefficients: c of it in `image`. (3, columns) float64
        rounding: length of the errors to be expected in `image` of float32 sums, since it was shaded.
        anchor: the last image of which every coefficient was summed, where that was in another light.
        exact_in: of what image, see `LiveTerm.key_of_image`, and in which region of the picture, it is the exact one.
        detail: of a preview, how often it was made of more samples.
        is_outdated: it is of another model than is wanted by now, or of other values of its fixed parameters.
    """

    image: F32
    fidelity: Fidelity = Fidelity.NOTHING
    bands: Mapping[str, F64] = field(default_factory=dict)
    light: Light | None = None
    basis: EditBasis | None = None
    coefficients: F64 | None = None
    rounding: float = 0.0
    anchor: Shown | None = None
    exact_in: tuple[Hashable, Tile] | None = None
    detail: int = 0
    is_outdated: bool = False

    @property
    def is_firm(self) -> bool:
        """Whether steps may be added to it: it is the sum of known coefficients in a known light."""
        return self.fidelity >= Fidelity.COARSE

    def differing(self, wanted: Mapping[str, F64]) -> list[str]:
        """Names of the wanted curves that the image does not show."""
        return [name for name, bands in wanted.items() if not np.array_equal(bands, self.bands.get(name, np.nan))]

    def in_other_light(self) -> Shown:
        """Nothing, from where changes of light can be followed."""
        anchor = replace(self, anchor=None) if self.is_firm else self.anchor
        return Shown(np.zeros_like(self.image), anchor=anchor)

    def summed(self, frozen: Operator, basis: EditBasis, target: Mapping[str, F64], light: Light) -> Shown:
        """The image of a target from all coefficients of an operator, written where this one's image stood.

        Args:
            frozen: the operator along `basis` in this light, of all samples, its dormant curves those of the target.
            target: bands of each of the term's curves. (3, J) each
        """
        coefficients = basis.coefficients(target)
        frozen.write_image(coefficients, self.image)
        fidelity = Fidelity.EXACT if basis.is_complete and frozen.is_exact else Fidelity.NEAR
        rounding = rounding_of(0.0, coefficients, frozen)
        return Shown(self.image, fidelity, dict(target), light, basis, coefficients, rounding).as_worn()

    def as_worn(self) -> Shown:
        """The same image; sums that left more in it than may be in an exact one make it a near one."""
        is_worn = self.rounding > MOST_IN_EXACT * length_of(self.image)
        return replace(self, fidelity=min(self.fidelity, Fidelity.NEAR)) if is_worn else self

    def without_basis(self) -> Shown:
        """The same image, which follows no operator any more."""
        return replace(self, basis=None, coefficients=None)


def length_of(image: F32) -> float:
    """Of an image as a vector over all its samples and channels."""
    flat = image.reshape(-1)
    return float(np.sqrt(np.dot(flat, flat)))


def rounding_of(length: float, change: F64, frozen: Operator) -> float:
    """Length of the rounding errors to be expected of R + Σ_j Δc_j T_j in float32, with unit roundoff u.

    u √(Σ_k (‖R‖ + Σ_{j≤k} |Δc_j| ‖T_j‖)² / 3), k over the additions to the image: each rounds a sum that is at most
    so long, by u/√3 of it on the mean; the sum of all of them, without the root, bounds it always, and is never met
    (Higham and Mary 2019). Columns may cancel, so that little is left of long sums: then what is left is mostly this.

    Args:
        length: of the image R. change: Δc. (3, J), or (L, 3, J). frozen: has the columns.
    """
    added = np.cumsum(np.abs(change) * frozen.importance, axis=-1)
    # columns are added in fours, those that are left over one by one
    which = np.cumsum(change != 0, axis=-1)
    is_last = (which % _COLUMNS_A_SUM == 0) | (which > which[..., -1:] // _COLUMNS_A_SUM * _COLUMNS_A_SUM)
    sums = np.where((change != 0) & is_last, length / math.sqrt(3) + added, 0.0)
    return UNIT_ROUNDOFF * float(np.sqrt((sums**2).sum() / 3))
