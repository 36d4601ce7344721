"""Fidelity of images, and the labels that frames report."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from typing import Literal, get_args


class Fidelity(IntEnum):
    """Exactness of an image with respect to its curves and its light, worst first.

    NOTHING: not computed yet. PREVIEW: interpolated between few samples. INCREMENTAL: an exact image plus an
    approximate update of changed light. COARSE: an exact image plus the update of a changed curve, computed from some
    of its samples or from merged lights. NEARLY_EXACT: a sum along the few nodes of a parameter, or of quantized
    columns.
    EXACT: the complete sum.
    """

    NOTHING = 0
    PREVIEW = 1
    INCREMENTAL = 2
    COARSE = 3
    NEARLY_EXACT = 4
    EXACT = 5


FidelityLabel = Literal["preview", "approximate", "incremental", "near_exact", "exact"]
"""Fidelity that a frame reports, worst first; "approximate": it shows an older look, or not all coefficients yet."""

_ORDER: tuple[FidelityLabel, ...] = get_args(FidelityLabel)


def fidelity_label(fidelity: Fidelity, *, is_current: bool) -> FidelityLabel:
    """Return the label of an image. is_current: it shows the target look."""
    if fidelity <= Fidelity.PREVIEW:
        return "preview"
    if not is_current:
        return "approximate"
    if fidelity <= Fidelity.COARSE:
        return "incremental"
    return "near_exact" if fidelity == Fidelity.NEARLY_EXACT else "exact"


def worst(labels: Iterable[FidelityLabel]) -> FidelityLabel:
    """Return the worst of several labels; "exact" if there are none."""
    return min(labels, key=_ORDER.index, default="exact")
