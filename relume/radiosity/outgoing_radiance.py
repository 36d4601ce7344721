"""Outgoing radiance of patches: isotropic, in a low-degree basis, and in direction bins for sharp highlights."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.math.direction_grid import NUM_DIRECTION_BINS
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.highlight_tables import HighlightTables
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight, ReflectanceOperator
from relume.transport.outgoing_patch_light import NUM_OUTGOING, OutgoingLight, decay_of, radiance_from_patch

F32 = NDArray[np.float32]
OutgoingHighlights = tuple[HighlightTables, F32]
"""Highlights of patches and their binned light. See `relume.radiosity.highlight_transport`. (F, 3, bins) float32"""


class BinnedRadiance(NamedTuple):
    """Additional binned outgoing radiance of some patches.

    Attributes:
        rows: these patches. radiance: radiance of each.
    """

    rows: Shaped[NDArray[np.intp], " F"]
    radiance: Shaped[F32, "F 3 bins"]

    def subtract(self, subtrahend: BinnedRadiance) -> BinnedRadiance:
        """Return the difference to another, which may have other rows."""
        rows = np.union1d(self.rows, subtrahend.rows)
        radiance = np.zeros((len(rows), *self.radiance.shape[1:]), np.float32)
        radiance[np.searchsorted(rows, self.rows)] = self.radiance
        radiance[np.searchsorted(rows, subtrahend.rows)] -= subtrahend.radiance
        return BinnedRadiance(rows, radiance)


EMPTY_BINS = BinnedRadiance(np.empty(0, np.intp), np.empty((0, 3, NUM_DIRECTION_BINS), np.float32))


class OutgoingRadiance(NamedTuple):
    """Outgoing radiance of patches.

    Attributes:
        isotropic: the isotropic part.
        rows: patches with directional light. coefficients: L_j of each.
        roughening: by their highlights, see `ReflectanceOperator`.
        bins: additional light of patches with sharp highlights.
        is_change: a difference of radiance, which may be negative.
    """

    isotropic: Shaped[F32, "patches 3"]
    rows: Shaped[NDArray[np.intp], " G"]
    coefficients: Shaped[F32, "G 3 J"]
    roughening: Shaped[F32, " G"]
    bins: BinnedRadiance = EMPTY_BINS
    is_change: bool = False

    def outgoing_light(
        self, patches: PatchLight, *, is_smoothed: bool = True, is_positive: bool = True
    ) -> OutgoingLight:
        """Tabulate for lookups by rays.

        Args:
            patches: the patches. is_smoothed: with a smoothed table, which narrow lobes need.
            is_positive: nowhere negative, except for a change; light that only patches gather may ring.
        """
        decay = decay_of(self.roughening) if is_smoothed else None
        bin_rows = np.searchsorted(self.rows, self.bins.rows)
        frames = patches.frames[self.rows]
        return radiance_from_patch(
            pad(self.isotropic), self.rows, frames, self.coefficients, decay, (bin_rows, self.bins.radiance),
            is_positive=is_positive and not self.is_change,
        )  # fmt: skip

    def mean_to_others(self, patches: PatchLight) -> Shaped[F32, "patches 3"]:
        """Return the mean radiance of each patch toward other patches, without the binned part."""
        return patches.mean_to_others(self.isotropic, self.coefficients, self.rows)

    def subtract(self, subtrahend: OutgoingRadiance) -> OutgoingRadiance:
        """Return the difference to another, which may have other rows."""
        rows = np.union1d(self.rows, subtrahend.rows)
        coefficients = np.zeros((len(rows), *self.coefficients.shape[1:]), np.float32)
        coefficients[np.searchsorted(rows, self.rows)] += self.coefficients
        coefficients[np.searchsorted(rows, subtrahend.rows)] -= subtrahend.coefficients
        roughening = np.zeros(len(rows), np.float32)
        for operand in (subtrahend, self):
            roughening[np.searchsorted(rows, operand.rows)] = operand.roughening
        return OutgoingRadiance(
            self.isotropic - subtrahend.isotropic, rows, coefficients, roughening, self.bins.subtract(subtrahend.bins),
            is_change=True,
        )  # fmt: skip


def isotropic_radiance(radiance: Shaped[F32, "patches 3"]) -> OutgoingRadiance:
    """Return outgoing radiance that is the same in all directions."""
    no_coefficients = np.empty((0, 3, NUM_OUTGOING), np.float32)
    return OutgoingRadiance(radiance, np.empty(0, np.intp), no_coefficients, np.empty(0, np.float32))


def first_bounce(
    reflectance_operator: ReflectanceOperator,
    incident: IncidentLight,
    outgoing_highlights: OutgoingHighlights | None = None,
) -> OutgoingRadiance:
    """Reflect incident light once.

    Args:
        reflectance_operator: reflectance operator of the patches. incident: light at the patches.
        outgoing_highlights: light reflected by sharp highlights; None: these use the low-degree basis.
    """
    isotropic, coefficients = reflectance_operator.apply(incident)
    if outgoing_highlights is None:
        return OutgoingRadiance(isotropic, reflectance_operator.rows, coefficients, reflectance_operator.roughening)
    highlights, radiance = outgoing_highlights
    coefficients[np.searchsorted(reflectance_operator.rows, highlights.rows)] = 0
    isotropic[highlights.rows] -= highlights.reflectance / np.float32(np.pi) * incident.irradiance[highlights.rows]
    return OutgoingRadiance(
        isotropic,
        reflectance_operator.rows,
        coefficients,
        reflectance_operator.roughening,
        BinnedRadiance(highlights.rows, radiance),
    )


def pad(radiance: Shaped[NDArray[np.floating], "patches 3"]) -> Shaped[F32, "padded 3"]:
    """Extend the radiance of patches by black rows, up to row `NO_PATCH`."""
    out = np.zeros((NO_PATCH + 1, 3), np.float32)
    out[: len(radiance)] = radiance
    return out
