"""What gather cells send out: evenly, by few functions, and by squares where those do not tell a highlight."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.math.direction_grid import NUM_DIRECTION_BINS
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.highlight_tables import HighlightTables
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight, ReflectanceOperator
from relume.transport.outgoing_patch_light import OutgoingLight, decay_of, radiance_from_patch

F32 = NDArray[np.float32]
OutgoingHighlights = tuple[HighlightTables, F32]
"""Highlights of patches and their outgoing light. See `relume.radiosity.highlight_transport`. (F, 3, bins) float32"""


class BinnedRadiance(NamedTuple):
    """What some cells send besides, by squares.

    Attributes:
        rows: these cells. (F,) intp. radiance: of each. (F, 3, squares) float32
    """

    rows: NDArray[np.intp]
    radiance: F32

    def subtract(self, subtrahend: BinnedRadiance) -> BinnedRadiance:
        """The difference to another, whose rows may be others."""
        rows = np.union1d(self.rows, subtrahend.rows)
        radiance = np.zeros((len(rows), *self.radiance.shape[1:]), np.float32)
        radiance[np.searchsorted(rows, self.rows)] = self.radiance
        radiance[np.searchsorted(rows, subtrahend.rows)] -= subtrahend.radiance
        return BinnedRadiance(rows, radiance)


EMPTY_BINS = BinnedRadiance(np.empty(0, np.intp), np.empty((0, 3, NUM_DIRECTION_BINS), np.float32))


class OutgoingRadiance(NamedTuple):
    """What cells send out.

    Attributes:
        isotropic: the part that is the same everywhere. (C, 3) float32
        rows: the cells that send more one way than another. (G,) intp. coefficients: L_j of each. (G, 3, J) float32
        roughening: by their highlights, see `ReflectanceOperator`. (G,) float32
        bins: what those of them send besides whose highlights are sharp.
    """

    isotropic: F32
    rows: NDArray[np.intp]
    coefficients: F32
    roughening: F32
    bins: BinnedRadiance = EMPTY_BINS

    def outgoing_light(self, patches: PatchLight, *, to_narrow_lobes: bool = True) -> OutgoingLight:
        """As rays look it up. to_narrow_lobes: whether rays of pictures do"""
        decay = decay_of(self.roughening) if to_narrow_lobes else None
        bin_rows = np.searchsorted(self.rows, self.bins.rows)
        frames = patches.frames[self.rows]
        return radiance_from_patch(
            pad(self.isotropic), self.rows, frames, self.coefficients, decay, (bin_rows, self.bins.radiance)
        )

    def mean_to_others(self, patches: PatchLight) -> F32:
        """What other cells see of each in the mean, that by squares left out. (C, 3) float32"""
        return patches.mean_to_others(self.isotropic, self.coefficients, self.rows)

    def subtract(self, subtrahend: OutgoingRadiance) -> OutgoingRadiance:
        """The difference to another, whose rows may be others."""
        rows = np.union1d(self.rows, subtrahend.rows)
        coefficients = np.zeros((len(rows), *self.coefficients.shape[1:]), np.float32)
        coefficients[np.searchsorted(rows, self.rows)] += self.coefficients
        coefficients[np.searchsorted(rows, subtrahend.rows)] -= subtrahend.coefficients
        roughening = np.zeros(len(rows), np.float32)
        for operand in (subtrahend, self):
            roughening[np.searchsorted(rows, operand.rows)] = operand.roughening
        return OutgoingRadiance(
            self.isotropic - subtrahend.isotropic, rows, coefficients, roughening, self.bins.subtract(subtrahend.bins)
        )


def first_bounce(
    reflectance_operator: ReflectanceOperator,
    incident: IncidentLight,
    outgoing_highlights: OutgoingHighlights | None = None,
) -> OutgoingRadiance:
    """What cells send of what comes to them.

    Args:
        reflectance_operator: what they make of it. incident: what comes.
        outgoing_highlights: what sharp highlights send; None: functions say it.
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


def pad(radiance: NDArray[np.floating[Any]]) -> F32:
    """Radiance of cells, (C, 3), and black for those that are none. (NO_CELL + 1, 3) float32"""
    out = np.zeros((NO_PATCH + 1, 3), np.float32)
    out[: len(radiance)] = radiance
    return out
