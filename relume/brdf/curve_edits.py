"""Relative edits of a curve: a factor and an offset for each band, so that unedited bands keep their values.

    edited = factor · before + offset

`factors` and `offsets` give them per band. `handles`, [degrees, value before, value after], drag the curve: between two
handles their edits are blended, so that one handle changes the curve as far as its neighbors
(docs/direct-light.md#curves-as-bands).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Curve

F64 = NDArray[np.float64]

RELATIVE = ("factors", "offsets", "handles")


def is_relative(drawn: Mapping[str, Any]) -> bool:
    """True if a freehand object has relative edits."""
    return any(name in drawn for name in RELATIVE)


def curve_edit(drawn: Mapping[str, Any], before: Shaped[F64, "3 J"]) -> tuple[Shaped[F64, "3 J"], Shaped[F64, "3 J"]]:
    """Factor and offset of each band of a curve.

    Args:
        drawn: the freehand object. before: band averages of the edited curve, not negative.
    Returns:
        factor, offset: not negative; exactly one and zero in unedited bands
    """
    factor, offset = (_rows(drawn, name, before, neutral) for name, neutral in (("factors", 1.0), ("offsets", 0.0)))
    if "handles" not in drawn:
        return factor, offset
    gain, lift = _handle_edits(np.asarray(drawn["handles"], np.float64), factor * before + offset)
    return gain * factor, gain * offset + lift


def evaluate_edit(rows: Shaped[F64, "3 J"], gamma: F64, max_angle: float, *, smooth: bool) -> Shaped[F64, "3 ..."]:
    """Evaluate band values at exact angles.

    Args:
        rows: a value for each channel and band.
        gamma: radians in [0, max_angle]. (...)
        max_angle: end of the last band, radians.
        smooth: interpolate linearly between band centers; otherwise values are constant in each band and keep averages.
    """
    num_bands = rows.shape[1]
    band_position = gamma * (num_bands / max_angle)
    if smooth:
        return np.stack([np.interp(band_position - 0.5, np.arange(num_bands), row) for row in rows])
    return rows[:, np.minimum(band_position.astype(np.intp), num_bands - 1)]


def _rows(drawn: Mapping[str, Any], name: str, like: F64, neutral: float) -> F64:
    """Broadcast one list for all channels, three lists of J, or 3·J flat values to (3, J)."""
    if name not in drawn:
        return np.full(like.shape, neutral)
    return np.broadcast_to(np.asarray(drawn[name], np.float64).reshape(-1, like.shape[1]), like.shape)


def _handle_edits(handles: F64, before: F64) -> tuple[F64, F64]:
    """Factor and offset of each band from its two neighboring handles. (3, J) each"""
    num_bands = before.shape[1]
    # the outer half of the first and last band belongs to its center: bands have no finer resolution
    handle_position = np.clip(handles[:, 0] * (num_bands / 90.0) - 0.5, 0.0, num_bands - 1.0)
    band = np.arange(num_bands)
    left = np.clip(np.searchsorted(handle_position, band, side="right") - 1, 0, len(handle_position) - 2)
    gap = handle_position[left + 1] - handle_position[left]
    fraction = np.clip((band - handle_position[left]) / np.where(gap > 0, gap, 1.0), 0.0, 1.0)
    towards_right = fraction * fraction * (3.0 - 2.0 * fraction)
    factor, offset = np.ones_like(before), np.zeros_like(before)
    for handle_index, weight in ((left, 1.0 - towards_right), (left + 1, towards_right)):
        gain, lift = _handle_edit(handles[handle_index, 1], handles[handle_index, 2], before)
        factor += weight * gain
        offset += weight * lift
    return factor, offset


def _handle_edit(from_value: F64, to_value: F64, before: F64) -> tuple[F64, F64]:
    """Edit of values by one handle: change = gain · before + lift. (3, J) each

    Values below the handle change in proportion, values above it by the same amount, so that nothing changes more than
    the handle, neither in amount nor in proportion. A handle that more than doubles its value adds the rest to the low
    values too, because no factor changes a curve that is zero.
    """
    change = to_value - from_value
    rise = np.maximum(change, 0.0)
    reach = np.maximum(from_value, rise)
    reach = np.where(reach > 0, reach, 1.0)
    is_low = before <= from_value
    high = np.where(is_low, 1.0, before)
    gain = np.where(is_low, change / reach, np.minimum(change, 0.0) / high)
    lift = np.where(is_low, rise * np.maximum(rise - from_value, 0.0) / reach, rise)
    return gain, lift


def drawn_curves(term_document: Mapping[str, Any], curve: Curve) -> list[dict[str, Any]]:
    """Freehand objects of one curve; a single object becomes a list of one."""
    drawn = (term_document.get("curves") or {}).get(curve.name)
    if drawn is None:
        return []
    return drawn if isinstance(drawn, list) else [drawn]
