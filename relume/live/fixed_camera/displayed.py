"""The state of a term's image: the look it shows, its fidelity, and the exact image that it can be updated from."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.look.model import Rgb
from relume.operators.edit_basis import EditBasis
from relume.operators.linear_operator import LinearOperator
from relume.operators.shade import ShadedTerm
from relume.views.view import Tile

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-24  # of float32

# Greatest rounding error of float32 sums in an exact image, as a fraction of the image's norm.
MAX_EXACT_ROUNDING = 2.0**-16
_COLUMNS_PER_SUM = 4  # columns that `relume.operators.update_kernel` adds to an image at once


@dataclass(frozen=True, eq=False)
class DisplayedImage:
    """The image of one term, before color, texture and outgoing curves.

    The image belongs to the picture's own thread: steps are added in place, and only its reference image shares it.

    Attributes:
        image: Σ_j c_j T_j, in tiles of samples.
        fidelity: how exactly it shows `bands` under `light`; APPROXIMATE: of another model, other fixed parameters, or
            other samples than the target's.
        bands: (3, J) float64 of each curve; NaN if only the most important coefficients have been updated.
        light: the illumination; None if nothing is shown.
        basis: the free coefficients of the active operator. coefficients: c along it in `image`.
        rounding: expected norm of the float32 rounding errors in `image` since it was shaded.
        reference: the last converged image, if that was in another light; None for a converged image.
        exact_region: the image key (see `LiveTerm.image_key`) and the image region in which it is exact.
        detail: number of refinements of a preview.
        traces_lobe: whether rays were traced along the lobe if it is narrow.
    """

    image: Shaped[F32, "tiles 3 samples"]
    fidelity: Fidelity = Fidelity.PREVIEW
    bands: Mapping[str, F64] = field(default_factory=dict)
    light: Illumination | None = None
    basis: EditBasis | None = None
    coefficients: F64 | None = None
    rounding: float = 0.0
    reference: DisplayedImage | None = None
    exact_region: tuple[Hashable, Tile] | None = None
    detail: int = 0
    traces_lobe: bool = True

    @property
    def is_empty(self) -> bool:
        """True if nothing has been computed."""
        return self.light is None

    @property
    def is_converged(self) -> bool:
        """True if steps may be added: it is the sum of known coefficients in a known light."""
        return not self.is_empty and self.reference is None and self.fidelity > Fidelity.PREVIEW

    def with_samples(
        self, rows: Shaped[F32, "n 3"], mask: Shaped[NDArray[np.bool_], " n"]
    ) -> Shaped[F32, "tiles 3 samples"]:
        """Return a copy of the image with some samples replaced. rows: new values. mask: the samples to replace."""
        return ShadedTerm.from_rows(np.where(mask[:, None], rows, ShadedTerm(self.image).rows(len(mask)))).image

    def changed_curves(self, target_bands: Mapping[str, F64]) -> list[str]:
        """Return the names of the target curves that the image does not show."""
        return [name for name, bands in target_bands.items() if not np.array_equal(bands, self.bands.get(name, np.nan))]

    def reset_for_new_light(self) -> DisplayedImage:
        """Return an empty image whose reference allows incremental updates of light."""
        reference = replace(self, reference=None) if self.is_converged else self.reference
        return DisplayedImage(np.zeros_like(self.image), reference=reference)

    def evaluate_operator(
        self, operator: LinearOperator, basis: EditBasis, target_bands: Mapping[str, F64], light: Illumination
    ) -> DisplayedImage:
        """Return the image of a target from all coefficients of an operator, written into this image's array.

        Args:
            operator: along `basis` in this light, of all samples, with its fixed curves at their targets.
            target_bands: bands of each of the term's curves. (3, J) each
        """
        coefficients = basis.coefficients(target_bands)
        operator.write_image(coefficients, self.image)
        fidelity = Fidelity.EXACT if basis.is_complete and operator.is_exact else Fidelity.NEAR_EXACT
        rounding = accumulated_error(0.0, coefficients, operator)
        return DisplayedImage(
            self.image, fidelity, dict(target_bands), light, basis, coefficients, rounding
        ).downgrade_if_inexact()

    def downgrade_if_inexact(self) -> DisplayedImage:
        """Return the same image, nearly exact at most if rounding errors exceed the limit for exact images."""
        is_inexact = self.rounding > MAX_EXACT_ROUNDING * norm_of(self.image)
        return replace(self, fidelity=min(self.fidelity, Fidelity.NEAR_EXACT)) if is_inexact else self

    def without_edit(self) -> DisplayedImage:
        """Return the same image without an active operator."""
        return replace(self, basis=None, coefficients=None)


def weighted_sum(
    start: Shaped[F32, "tiles 3 samples"], weighted_images: Sequence[tuple[F32, Rgb]]
) -> Shaped[F32, "tiles 3 samples"]:
    """Add Σ g R to an image in place (transport is linear in light), and return it.

    Args:
        start: the image, overwritten. weighted_images: images of the same shape, with a gain per channel.
    """
    for image, gain in weighted_images:
        start += np.array(gain, np.float32)[:, None] * image
    return start


def norm_of(image: Shaped[F32, " ..."]) -> float:
    """Return the Euclidean norm of an image over all its samples and channels."""
    flat = image.reshape(-1)
    return float(np.sqrt(np.dot(flat, flat)))


def accumulated_error(norm: float, change: Shaped[F64, "*levels 3 J"], operator: LinearOperator) -> float:
    """Expected norm of the rounding errors of R + Σ_j Δc_j T_j in float32, with unit roundoff u.

    u √(Σ_k (‖R‖ + Σ_{j≤k} |Δc_j| ‖T_j‖)² / 3), k over the additions to the image: each addition rounds a sum of at most
    this norm by u/√3 of it on average. The sum without the root is a strict bound that is never reached (Higham and
    Mary
    2019). Columns may cancel; the remaining image is then mostly rounding error.

    Args:
        norm: norm of the image R. change: Δc. operator: provides the norms of the columns.
    """
    added = np.cumsum(np.abs(change) * operator.importance, axis=-1)
    # columns are added in groups of four, the remaining ones one by one
    column_number = np.cumsum(change != 0, axis=-1)
    is_last = (column_number % _COLUMNS_PER_SUM == 0) | (
        column_number > column_number[..., -1:] // _COLUMNS_PER_SUM * _COLUMNS_PER_SUM
    )
    sums = np.where((change != 0) & is_last, norm / math.sqrt(3) + added, 0.0)
    return UNIT_ROUNDOFF * float(np.sqrt((sums**2).sum() / 3))
