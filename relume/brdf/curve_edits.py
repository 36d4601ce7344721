"""Edits of a curve relative to what it was: of each band a factor and an offset, so that a band nobody touched stays.

    edited = factor · before + offset

`factors` and `offsets` give them band by band. `handles`, [degrees, was, becomes], pull the result: between two of them
the pulls of both are blended, so that one handle moves the curve as far as its neighbours and no farther
(docs/direct-light.md#curves-as-bands).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

RELATIVE = ("factors", "offsets", "handles")


def is_relative(drawn: Mapping[str, Any]) -> bool:
    """Whether a freehand object says anything relative to what the curve was."""
    return any(name in drawn for name in RELATIVE)


def curve_edit(drawn: Mapping[str, Any], before: F64) -> tuple[F64, F64]:
    """What multiplies each band of a curve, and what is then added.

    Args:
        before: band averages of what is edited, not negative. (3, J)
    Returns:
        factor, offset: (3, J) each, not negative; exactly one and zero in bands that are not edited
    """
    factor, offset = (_rows(drawn, name, before, neutral) for name, neutral in (("factors", 1.0), ("offsets", 0.0)))
    if "handles" not in drawn:
        return factor, offset
    gain, lift = _handle_edits(np.asarray(drawn["handles"], np.float64), factor * before + offset)
    return gain * factor, gain * offset + lift


def evaluate_edit(rows: F64, gamma: F64, max_angle: float, *, smooth: bool) -> F64:
    """Numbers of bands at exact angles: those of the band, so that averages hold; `smooth`, linear between middles.

    Args:
        rows: a number for each band and channel. (3, J)
        gamma: radians in [0, max_angle]. (...)
        max_angle: where the last band ends, radians.
        smooth: whether to go linearly from one band's middle to the next one's, instead of in steps.
    Returns:
        (3, ...) float64
    """
    num_bands = rows.shape[1]
    band_position = gamma * (num_bands / max_angle)
    if smooth:
        return np.stack([np.interp(band_position - 0.5, np.arange(num_bands), row) for row in rows])
    return rows[:, np.minimum(band_position.astype(np.intp), num_bands - 1)]


def _rows(drawn: Mapping[str, Any], name: str, like: F64, neutral: float) -> F64:
    """(3, J), from one J for all channels, three lists of J, or 3·J flat."""
    if name not in drawn:
        return np.full(like.shape, neutral)
    return np.broadcast_to(np.asarray(drawn[name], np.float64).reshape(-1, like.shape[1]), like.shape)


def _handle_edits(handles: F64, before: F64) -> tuple[F64, F64]:
    """Factor and offset of each band by its two neighbouring handles. (3, J) each"""
    num_bands = before.shape[1]
    # the outer half of the first and the last band belongs to its middle: there is nothing finer
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
    """How one handle moves values: change = gain · before + lift. (3, J) each

    What is lower than the handle moves in proportion, what is higher as far as the handle, so that nothing moves
    farther than the hand, neither in amount nor in proportion. A handle that more than doubles what was there adds the
    rest to the low ones too: nothing can be multiplied out of a curve that is zero.
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
