"""What points send of the sky in highlights: summed over the light triangles that each of them sees.

    B / a = (1 − β) (L_2 / a) + Σ_l V_l E_l T(x_l, ψ_l) / (x_h + α²)²

T is a table of the highlight (`relume.moving.basis.shapes`), V_l a bit. Nothing is approximated but the shape of the
table, and that light comes from where triangles are, as wide as they are.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.moving.basis.lobes import Lobes
from relume.moving.basis.out_factors import NUM_ROWS
from relume.moving.basis.rows import LEAST_COSINE, row_of
from relume.moving.basis.shapes import LEAST_EXPONENT, NUM_PLACES, NUM_RINGS, NUM_SPOKES, WIDTHS, rings
from relume.moving.points.surface import Surface
from relume.parallel import for_shares

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

BLOCK = 64  # lights that are summed together, or not at all where none of them is seen
_LEAST = np.float32(2.0**LEAST_EXPONENT)
LEAST_BITS = np.int32(np.float32(_LEAST).view(np.int32))
_HALF_OCTAVE = np.float32(2.0**-22)  # of bits of a float: a ring
_LAST_RING, _LAST_SPOKE = np.float32(NUM_RINGS - 1.001), np.float32(NUM_SPOKES - 1.001)
_WIDTH_OF_RADIUS = 8.0  # a triangle's r² over that of the circle about it: of an equilateral one, along an axis
_PER_SPOKE = np.float32(NUM_SPOKES / math.pi)


class SkyLights(NamedTuple):
    """The light triangles of a sky, whole blocks of them.

    Attributes:
        towards: unit, one axis after another. (3, lights) float32
        irradiance: E in each channel; none of those beyond the last. (3, lights) float32
        table: where the table of its width begins. (lights,) int32
    """

    towards: F32
    irradiance: F32
    table: NDArray[np.int32]

    @classmethod
    def of(cls, directions: F32, irradiance: F32, radius: F32) -> SkyLights:
        """Put them into blocks.

        Args:
            directions, irradiance: of each light. (lights, 3) float32
            radius: of a circle about each, radians. (lights,) float32
        """
        num = len(directions)
        whole = -(-num // BLOCK) * BLOCK
        towards, light, table = np.zeros((3, whole), np.float32), np.zeros((3, whole), np.float32), np.zeros(whole)
        towards[2], towards[:, :num], light[:, :num] = 1, directions.T, irradiance.T
        bounds = np.multiply(WIDTHS[1:], WIDTHS[:-1]) * _WIDTH_OF_RADIUS
        table[:num] = np.searchsorted(bounds, np.square(radius)) * NUM_PLACES
        return cls(towards, light, table.astype(np.int32))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def _arc_cosine(x):  # type: ignore[no-untyped-def]
    """Find arc cos x, x in [−1, 1], to 1e-4: Abramowitz and Stegun 4.4.45."""
    size = abs(x)
    arc = np.float32(-0.0187293) * size + np.float32(0.0742610)
    arc = (arc * size - np.float32(0.2121144)) * size + np.float32(1.5707288)
    arc *= math.sqrt(np.float32(1) - size)
    return arc if x >= 0 else np.float32(math.pi) - arc


# In one piece: arrays that are handed to functions, even to inlined ones, are counted as references, at every point.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _sum(points, material, visible, lights, lobes, eye, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the lights of the points that are [start, stop) of rows. out: (points, 3), written there"""
    position, normal, _, _, _ = points
    towards, irradiance, first_place = lights
    bits, psi, scale = np.empty(BLOCK, np.uint8), np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    x = np.empty(BLOCK, np.float32)
    bits_of_x = x.view(np.int32)
    table = np.empty(lobes.shape.shape[2] * lobes.shape.shape[3], np.float32)
    for p in rows[start:stop]:
        out[p, 0] = out[p, 1] = out[p, 2] = 0
        lobe = lobes.of[material[p]]
        if lobe < 0:
            continue
        nx, ny, nz = normal[p, 0], normal[p, 1], normal[p, 2]
        ox, oy, oz = eye[0] - position[p, 0], eye[1] - position[p, 1], eye[2] - position[p, 2]
        per = np.float32(1) / math.sqrt(max(ox * ox + oy * oy + oz * oz, np.float32(1e-20)))
        ox, oy, oz = per * ox, per * oy, per * oz
        facing: Any = min(max(nx * ox + ny * oy + nz * oz, LEAST_COSINE), np.float32(1))
        row, share = row_of(facing)
        for width in range(lobes.shape.shape[2]):
            for k in range(NUM_PLACES):
                near = lobes.shape[lobe, row, width, k]
                table[width * NUM_PLACES + k] = near + share * (lobes.shape[lobe, row + 1, width, k] - near)
        flatness = lobes.flatness[lobe]
        double = np.float32(2) * facing
        mx, my, mz = double * nx - ox, double * ny - oy, double * nz - oz
        # across the mirror direction, in the plane of n and o
        ex, ey, ez = nx - facing * mx, ny - facing * my, nz - facing * mz
        per = np.float32(1) / math.sqrt(max(ex * ex + ey * ey + ez * ez, np.float32(1e-12)))
        ex, ey, ez = per * ex, per * ey, per * ez
        red = green = blue = np.float32(0)
        for first in range(0, first_place.shape[0], BLOCK):
            is_any = np.uint8(0)
            for k in range(BLOCK // 8):
                byte = (first >> 3) + k
                eight = visible[p, byte] if byte < visible.shape[1] else np.uint8(0)
                is_any |= eight
                for bit in range(8):
                    bits[8 * k + bit] = (eight >> bit) & 1
            if is_any == 0:
                continue
            for k in range(BLOCK):
                lx, ly, lz = towards[0, first + k], towards[1, first + k], towards[2, first + k]
                along, aside = mx * lx + my * ly + mz * lz, ex * lx + ey * ly + ez * lz
                off: Any = min(max(np.float32(2) - np.float32(2) * along, _LEAST), np.float32(4))
                flat = math.sqrt(max(off * (np.float32(1) - np.float32(0.25) * off), np.float32(1e-12)))
                x[k] = off
                psi[k] = _arc_cosine(min(max(aside / flat, np.float32(-1)), np.float32(1)))
                both = max(np.float32(2) + np.float32(2) * (ox * lx + oy * ly + oz * lz), np.float32(1e-6))
                half = (nx * lx + ny * ly + nz * lz + facing) / math.sqrt(both)
                below = max(np.float32(2) - np.float32(2) * half, np.float32(0)) + flatness
                scale[k] = bits[k] / (below * below)
            for k in range(BLOCK):
                ring: Any = min(np.float32(bits_of_x[k] - LEAST_BITS) * _HALF_OCTAVE, _LAST_RING)
                spoke: Any = min(max(psi[k] * _PER_SPOKE - np.float32(0.5), np.float32(0)), _LAST_SPOKE)
                r, s = np.int32(ring), np.int32(spoke)
                fr, fs = ring - np.float32(r), spoke - np.float32(s)
                at = first_place[first + k] + r * NUM_SPOKES + s
                near = table[at] + fs * (table[at + 1] - table[at])
                far = table[at + NUM_SPOKES] + fs * (table[at + NUM_SPOKES + 1] - table[at + NUM_SPOKES])
                sent = scale[k] * (near + fr * (far - near))
                red += sent * irradiance[0, first + k]
                green += sent * irradiance[1, first + k]
                blue += sent * irradiance[2, first + k]
        out[p, 0], out[p, 1], out[p, 2] = red, green, blue


def by_lights(
    surface: Surface,
    visible: NDArray[np.uint8],
    lights: SkyLights,
    lobes: Lobes,
    eye: F32,
    is_needed: NDArray[np.uint8],
    out: F32 | None = None,
) -> F32:
    """Sum the lights that points see in their highlights.

    Args:
        surface: whose points. visible: light l of a point in bit l & 7 of byte l >> 3. (points, bytes) uint8
        lights: of the sky. lobes: of all materials. eye: where it is. (3,) float32
        is_needed: points that are asked. (points,) uint8
        out: written where needed; None: the others get nothing.
    Returns:
        Σ, of unit albedo, of what lobes are not believed. (points, 3) float32
    """
    found = np.zeros((len(visible), 3), np.float32) if out is None else out
    rows = np.flatnonzero(is_needed.view(np.bool_))
    args = surface.points, surface.material, visible, lights, lobes, np.ascontiguousarray(eye, np.float32), rows
    for_shares(lambda start, stop: _sum(*args, start, stop, found), len(rows))
    return found


def by_lights_numpy(
    surface: Surface, visible: NDArray[np.uint8], lights: SkyLights, lobes: Lobes, eye: F32, point: int
) -> F64:
    """Do as `by_lights` for one point with a lobe, in plain NumPy: its oracle. (3,)"""
    n, lobe = surface.points.normal[point].astype(np.float64), lobes.of[surface.material[point]]
    wo = eye.astype(np.float64) - surface.points.position[point]
    wo /= np.linalg.norm(wo)
    facing = float(np.clip(n @ wo, LEAST_COSINE, 1))
    place = np.sqrt(1 - facing) * (NUM_ROWS - 1)
    row = min(int(place), NUM_ROWS - 2)
    table = (1 - (place - row)) * lobes.shape[lobe, row] + (place - row) * lobes.shape[lobe, row + 1]
    table = table.astype(np.float64).reshape(len(WIDTHS), NUM_RINGS, NUM_SPOKES)
    mirror = 2 * facing * n - wo
    across = n - facing * mirror
    across /= max(float(np.linalg.norm(across)), 1e-6)
    num = min(8 * visible.shape[1], lights.towards.shape[1])
    is_seen = np.unpackbits(visible[point], bitorder="little")[:num] > 0
    wi = lights.towards[:, :num].T.astype(np.float64)[is_seen]
    x = np.clip(2 - 2 * wi @ mirror, rings()[0], 4)
    psi = np.arccos(np.clip(wi @ across / np.sqrt(np.maximum(x * (1 - x / 4), 1e-12)), -1, 1))
    half = (wi @ n + facing) / np.linalg.norm(wi + wo, axis=1)
    ring = np.interp(x, rings(), np.arange(NUM_RINGS))
    spoke = np.clip(psi / np.pi * NUM_SPOKES - 0.5, 0, NUM_SPOKES - 1)
    r, s = np.minimum(ring.astype(int), NUM_RINGS - 2), np.minimum(spoke.astype(int), NUM_SPOKES - 2)
    fr, fs, width = ring - r, spoke - s, lights.table[:num][is_seen] // NUM_PLACES
    near = (1 - fs) * table[width, r, s] + fs * table[width, r, s + 1]
    far = (1 - fs) * table[width, r + 1, s] + fs * table[width, r + 1, s + 1]
    sent = ((1 - fr) * near + fr * far) / (np.maximum(2 - 2 * half, 0) + lobes.flatness[lobe]) ** 2
    return np.asarray(lights.irradiance[:, :num][:, is_seen].astype(np.float64) @ sent)
