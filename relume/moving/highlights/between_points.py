"""What is interpolated between points of the sky in highlights: all but the lobe that each pixel has anew.

    B(pixel) = L(pixel) + Σ_points w (B − L),   L(ωo) = a(θo) (V L̄(ωm, σ) + Σ_lamps V_j L̄_j(ωm, σ))

L is the sky in a lobe (`relume.moving.basis.lobes`), times what a point sees of it: a control variate; in fine frames,
and where one lobe would stand for the highlight badly, L_2, the sky in two. It is what turns fastest where surfaces are
curved, twice as fast as their normals. B is summed over lights (`relume.moving.highlights.by_lights`), or it is what
the in-basis says, Σ_k p_k t_k of the sky, where that tells as much. Beside what is bright this rings, and says what
cannot be: it is held within a multiple of L_2; the more the in-basis misses, the smaller is the multiple. Lights are
summed for the normal of a point: where a normal map bends it by more than a lobe is wide, L_2 alone is believed.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.basis.lobes import Lobes
from relume.moving.evaluate import Sent
from relume.moving.highlights.looking import SkyLight, add_sky_in_lobe, along_both, along_lobe
from relume.moving.points.surface import Surface
from relume.parallel import for_shares

F32 = NDArray[np.float32]

BUMPY = np.float32(4)  # σ² of normals over that of a lobe, which turns twice as far


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _add(points, material, lobes, light, eye, glances, lit, bumpiness, is_fine, rows, start, stop, sent, sky):  # type: ignore[no-untyped-def]
    """Add B − L to what the points that are [start, stop) of rows send. sent, sky: (points, groups, 3)"""
    position, normal, _, _, _ = points
    shown, both = np.empty(3, np.float32), np.empty(3, np.float32)
    for p in rows[start:stop]:
        lobe = lobes.of[material[p]]
        if lobe < 0:
            continue
        n = normal[p, 0], normal[p, 1], normal[p, 2]
        x, y, z = position[p, 0] - eye[0], position[p, 1] - eye[1], position[p, 2] - eye[2]
        scale = np.float32(1) / math.sqrt(max(x * x + y * y + z * z, np.float32(1e-20)))
        d = scale * x, scale * y, scale * z
        seen = glances[p, 0], glances[p, 1], glances[p, 2]
        for channel in range(3):
            shown[channel] = both[channel] = 0
        row, share, one, other, first, sigma, sigma_2 = along_both(lobes, lobe, n, d)
        add_sky_in_lobe(light, seen, one, sigma, first, both)
        add_sky_in_lobe(light, seen, other, sigma_2, np.float32(1) - first, both)
        if is_fine or lobes.is_two[lobe]:
            shown[0], shown[1], shown[2] = both[0], both[1], both[2]
        else:
            _, _, ray, wide = along_lobe(lobes, lobe, n, d)
            add_sky_in_lobe(light, seen, ray, wide, np.float32(1), shown)
        most, near = lobes.most[lobe], lobes.believed[lobe, row]
        believed = near + share * (lobes.believed[lobe, row + 1] - near)
        sigma = min(sigma, sigma_2)
        flat = sigma * sigma / (sigma * sigma + BUMPY * bumpiness[material[p]])
        for channel in range(3):
            both[channel] += flat * (lit[p, channel] - (np.float32(1) - believed) * both[channel])
        for group in range(sent.shape[1]):
            for channel in range(3):
                near = lobes.albedo[lobe, row, group, channel]
                albedo = light.gain[channel] * (near + share * (lobes.albedo[lobe, row + 1, group, channel] - near))
                said = albedo * both[channel]
                held = min(max(sky[p, group, channel], said / most), said * most)
                sent[p, group, channel] += held - albedo * shown[channel]


def add_sky_in_highlights(
    surface: Surface,
    lobes: Lobes,
    light: SkyLight,
    eye: F32,
    glances: F32,
    lit: F32,
    is_needed: NDArray[np.uint8],
    sent: Sent,
    *,
    is_fine: bool,
) -> None:
    """Add what points know of the sky in highlights, less what pixels find.

    Args:
        surface: whose points. lobes: of all materials. light: that they show. eye: where it is. (3,) float32
        glances: of the points along their lobes, from `relume.moving.highlights.glances`. (points, 3)
        lit: by lights, from `relume.moving.highlights.by_lights`. (points, 3)
        is_needed: points that are asked. (points,) uint8
        sent: by them; its radiance is added to. is_fine: pixels find two lobes for a highlight, not one.
    """
    rows = np.flatnonzero(is_needed.view(np.bool_))
    seen = np.ascontiguousarray(eye, np.float32), glances, lit, surface.bumpiness
    args = (surface.points, surface.material, lobes, light, *seen, is_fine, rows)
    for_shares(lambda start, stop: _add(*args, start, stop, *sent), len(rows))
