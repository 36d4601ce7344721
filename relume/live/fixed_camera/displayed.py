"""The one state of a term's image: what it shows, how truly, and from which exact image it can go on."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.operators.edit_basis import EditBasis
from relume.operators.operator import Operator
from relume.views.view import Tile

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-24  # of float32

# Share of an image's length that float32 sums may have left in it where it is called exact.
MAX_EXACT_ROUNDING = 2.0**-16
_COLUMNS_PER_SUM = 4  # that `relume.operators.update_kernel` adds to an image at once


@dataclass(frozen=True, eq=False)
class DisplayedImage:
    """What an image of one term shows, before colour, texture and outgoing curves.

    The image belongs to the picture's own thread: steps are added in place, and nothing else keeps it but its anchor.

    Attributes:
        image: Σ_j c_j T_j. (tiles, 3, samples) float32
        fidelity: how truly it shows `bands` under `light`.
        bands: of each curve, (3, J) float64; not a number where only the most important coefficients have been moved.
        light: what arrives; None where nothing is shown.
        basis: what the operator in use leaves free. coefficients: c of it in `image`. (3, columns) float64
        rounding: length of the errors to be expected in `image` of float32 sums, since it was shaded.
        reference: the last image of which every coefficient was summed, where that was in another light.
        exact_region: of what image, see `LiveTerm.image_key`, and in which region of the picture, it is the exact one.
        detail: of a preview, how often it was made of more samples.
        is_outdated: it is of another model than is wanted by now, or of other values of its fixed parameters.
    """

    image: F32
    fidelity: Fidelity = Fidelity.NOTHING
    bands: Mapping[str, F64] = field(default_factory=dict)
    light: Illumination | None = None
    basis: EditBasis | None = None
    coefficients: F64 | None = None
    rounding: float = 0.0
    reference: DisplayedImage | None = None
    exact_region: tuple[Hashable, Tile] | None = None
    detail: int = 0
    is_outdated: bool = False

    @property
    def is_converged(self) -> bool:
        """Whether steps may be added to it: it is the sum of known coefficients in a known light."""
        return self.fidelity >= Fidelity.COARSE

    def changed_curves(self, target_bands: Mapping[str, F64]) -> list[str]:
        """Names of the wanted curves that the image does not show."""
        return [name for name, bands in target_bands.items() if not np.array_equal(bands, self.bands.get(name, np.nan))]

    def reset_for_new_light(self) -> DisplayedImage:
        """Nothing, from where changes of light can be followed."""
        reference = replace(self, reference=None) if self.is_converged else self.reference
        return DisplayedImage(np.zeros_like(self.image), reference=reference)

    def evaluate_operator(
        self, operator: Operator, basis: EditBasis, target_bands: Mapping[str, F64], light: Illumination
    ) -> DisplayedImage:
        """The image of a target from all coefficients of an operator, written where this one's image stood.

        Args:
            operator: the operator along `basis` in this light, of all samples, its dormant curves those of the target.
            target_bands: bands of each of the term's curves. (3, J) each
        """
        coefficients = basis.coefficients(target_bands)
        operator.write_image(coefficients, self.image)
        fidelity = Fidelity.EXACT if basis.is_complete and operator.is_exact else Fidelity.NEARLY_EXACT
        rounding = accumulated_error(0.0, coefficients, operator)
        return DisplayedImage(
            self.image, fidelity, dict(target_bands), light, basis, coefficients, rounding
        ).downgrade_if_inexact()

    def downgrade_if_inexact(self) -> DisplayedImage:
        """The same image; sums that left more in it than may be in an exact one make it a near one."""
        is_inexact = self.rounding > MAX_EXACT_ROUNDING * norm_of(self.image)
        return replace(self, fidelity=min(self.fidelity, Fidelity.NEARLY_EXACT)) if is_inexact else self

    def without_edit(self) -> DisplayedImage:
        """The same image, which follows no operator any more."""
        return replace(self, basis=None, coefficients=None)


def norm_of(image: F32) -> float:
    """Of an image as a vector over all its samples and channels."""
    flat = image.reshape(-1)
    return float(np.sqrt(np.dot(flat, flat)))


def accumulated_error(norm: float, change: F64, operator: Operator) -> float:
    """Length of the rounding errors to be expected of R + Σ_j Δc_j T_j in float32, with unit roundoff u.

    u √(Σ_k (‖R‖ + Σ_{j≤k} |Δc_j| ‖T_j‖)² / 3), k over the additions to the image: each rounds a sum that is at most
    so long, by u/√3 of it on the mean; the sum of all of them, without the root, bounds it always, and is never met
    (Higham and Mary 2019). Columns may cancel, so that little is left of long sums: then what is left is mostly this.

    Args:
        norm: of the image R. change: Δc. (3, J), or (L, 3, J). operator: has the columns.
    """
    added = np.cumsum(np.abs(change) * operator.importance, axis=-1)
    # columns are added in fours, those that are left over one by one
    column_number = np.cumsum(change != 0, axis=-1)
    is_last = (column_number % _COLUMNS_PER_SUM == 0) | (
        column_number > column_number[..., -1:] // _COLUMNS_PER_SUM * _COLUMNS_PER_SUM
    )
    sums = np.where((change != 0) & is_last, norm / math.sqrt(3) + added, 0.0)
    return UNIT_ROUNDOFF * float(np.sqrt((sums**2).sum() / 3))
