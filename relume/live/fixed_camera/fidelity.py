"""How truly an image shows what it shows, and how near a picture is to its look."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from typing import Literal, get_args


class Fidelity(IntEnum):
    """How truly an image shows the curves and the light that it is said to show, worst first.

    NOTHING: nothing has been made. PREVIEW: interpolated between few samples. FOLLOWED: an exact image and what has
    changed of light since, evaluated roughly. COARSE: an exact image and what has changed of a curve since, found at
    some of its samples or in merged lights. NEAR: a sum along the few nodes of a parameter, or of packed columns.
    EXACT: the whole sum.
    """

    NOTHING = 0
    PREVIEW = 1
    INCREMENTAL = 2
    COARSE = 3
    NEARLY_EXACT = 4
    EXACT = 5


FidelityLabel = Literal["preview", "approximate", "incremental", "near_exact", "exact"]
"""What a frame says of its picture, worst first; "approximate": it shows an older look, or not all coefficients yet."""

_ORDER: tuple[FidelityLabel, ...] = get_args(FidelityLabel)


def fidelity_label(fidelity: Fidelity, *, is_current: bool) -> FidelityLabel:
    """The word for an image of some fidelity; `is_current`: what it shows is what the look asks for."""
    if fidelity <= Fidelity.PREVIEW:
        return "preview"
    if not is_current:
        return "approximate"
    if fidelity <= Fidelity.COARSE:
        return "incremental"
    return "near_exact" if fidelity == Fidelity.NEARLY_EXACT else "exact"


def worst(labels: Iterable[FidelityLabel]) -> FidelityLabel:
    """What can be said of several images together; "exact" of none."""
    return min(labels, key=_ORDER.index, default="exact")
