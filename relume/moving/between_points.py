"""What is interpolated between points: all that they send but the sky in their highlights, which each pixel has anew.

    B(pixel) = L(pixel) + Σ_points w (B − L),   L(ωo) = a(θo) V(ωm) L̄(ωm, σ)

L is the sky about the mean direction of a lobe (`relume.moving.basis.lobes`), times what a point sees of it: a control
variate. It is what turns fastest where surfaces are curved, twice as fast as their normals.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.basis.lobes import Lobes
from relume.moving.glints import along_lobe
from relume.moving.points.surface import Surface
from relume.moving.sky import Sky, sky_about
from relume.parallel import for_shares

F32 = NDArray[np.float32]


class SkyLight(NamedTuple):
    """The sky that lobes show.

    Attributes:
        sky: its levels. turn: of it, from `turn_of`. gain: of its light, in each channel. (3,) float32
    """

    sky: Sky
    turn: np.float32
    gain: F32


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _take_off(points, material, lobes, light, eye, glances, rows, start, stop, sent):  # type: ignore[no-untyped-def]
    """Take L off what the points that are [start, stop) of rows send. sent: (points, groups, 3)"""
    position, normal, _, _ = points
    found = np.empty(3, np.float32)
    for p in rows[start:stop]:
        lobe = lobes.of[material[p]]
        if lobe < 0 or not lobes.is_told[lobe]:
            continue
        n = normal[p, 0], normal[p, 1], normal[p, 2]
        x, y, z = position[p, 0] - eye[0], position[p, 1] - eye[1], position[p, 2] - eye[2]
        scale = np.float32(1) / np.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
        row, share, rx, ry, rz, sigma = along_lobe(lobes, lobe, n, (scale * x, scale * y, scale * z))
        sky_about(light.sky, light.turn, rx, ry, rz, sigma, found)
        for channel in range(3):
            found[channel] *= glances[p, 0] * light.gain[channel]
        for group in range(sent.shape[1]):
            for channel in range(3):
                near = lobes.albedo[lobe, row, group, channel]
                albedo = near + share * (lobes.albedo[lobe, row + 1, group, channel] - near)
                sent[p, group, channel] -= albedo * found[channel]


def take_off_lobes(
    surface: Surface, lobes: Lobes, light: SkyLight, eye: F32, glances: F32, is_needed: NDArray[np.uint8], sent: F32
) -> None:
    """Take the lobes that the in-basis tells, too, off what points send.

    Args:
        surface: whose points. lobes: of all materials. light: that they show. eye: where it is. (3,) float32
        glances: of the points along their lobes, from `relume.moving.glints`. (points, 4) float32
        is_needed: points that are asked. (points,) uint8
        sent: by them, written. (points, groups, 3) float32
    """
    rows = np.flatnonzero(is_needed.view(np.bool_))
    args = (surface.points, surface.material, lobes, light, np.ascontiguousarray(eye, np.float32), glances, rows)
    for_shares(lambda start, stop: _take_off(*args, start, stop, sent), len(rows))
