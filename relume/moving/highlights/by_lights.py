"""What points send of the sky in highlights: summed over the light triangles that each of them sees.

    B / a = (1 − β) (L_2 / a) + Σ_l V_l E_l T(x_l, ψ_l) / (x_h + α²)²

T is a table of the highlight (`relume.moving.basis.shapes`), V_l a bit. Nothing is approximated but the shape of the
table, and that light comes from where triangles are, as wide as they are: four that lie beside each other are one light
where they are seen together, in the middle of those that are seen, and as wide as these are apart.
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

GROUP = 4  # lights beside each other that are one where a point sees several of them
_LEAST = np.float32(2.0**LEAST_EXPONENT)
LEAST_BITS = np.int32(np.float32(_LEAST).view(np.int32))
_HALF_OCTAVE = np.float32(2.0**-22)  # of bits of a float: a ring
_LAST_RING, _LAST_SPOKE = np.float32(NUM_RINGS - 1.001), np.float32(NUM_SPOKES - 1.001)
_WIDTH_OF_RADIUS = 8.0  # a triangle's r² over that of the circle about it: of an equilateral one, along an axis
_PER_SPOKE = np.float32(NUM_SPOKES / math.pi)


class SkyLights(NamedTuple):
    """The light triangles of a sky, in groups: of each group one light for every combination that is seen.

    Attributes:
        lights: of each combination the mean direction, unit, then Σ E in each channel. (16 groups, 6) float32
        table: where the table of its width begins. (16 groups,) int32
    """

    lights: F32
    table: NDArray[np.int32]

    @classmethod
    def of(cls, directions: F32, irradiance: F32, radius: F32) -> SkyLights:
        """Put lights together that follow each other.

        Args:
            directions, irradiance: of each light, those beside each other one after another. (lights, 3) float32
            radius: of a circle about each, radians. (lights,) float32
        """
        num = -(-len(directions) // GROUP) * GROUP
        rows = np.zeros((num, 7))
        rows[: len(directions)] = np.column_stack([directions, irradiance, np.square(radius) / _WIDTH_OF_RADIUS])
        towards, light, own = np.split(rows.reshape(-1, 1, GROUP, 7), [3, 6], axis=-1)
        is_in = (np.arange(2**GROUP)[:, None] >> np.arange(GROUP)) & 1
        share = is_in * np.maximum(light.max(axis=-1), 1e-30)
        share /= np.maximum(share.sum(axis=-1, keepdims=True), 1e-30)
        mean = np.einsum("gmk,gmkc->gmc", share, np.broadcast_to(towards, (*share.shape, 3)))
        length = np.linalg.norm(mean, axis=-1)
        variance = (share * own[..., 0]).sum(axis=-1) + 1 - length
        mean /= np.maximum(length, 1e-30)[..., None]
        lights = np.concatenate([mean, (is_in[..., None] * light).sum(axis=2)], axis=-1)
        table = np.searchsorted(np.multiply(WIDTHS[1:], WIDTHS[:-1]), variance) * NUM_PLACES
        return cls(lights.reshape(-1, 6).astype(np.float32), table.ravel().astype(np.int32))


# In one piece: arrays that are handed to functions, even to inlined ones, are counted as references, at every point.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _sum(points, material, visible, sky, lobes, eye, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the lights of the points that are [start, stop) of rows. out: (points, 3), written there"""
    position, normal, _, _, _ = points
    lights, table_of = sky
    shape = lobes.shape.reshape(lobes.shape.shape[0], lobes.shape.shape[1], lobes.shape.shape[2] * NUM_PLACES)
    num_groups = lights.shape[0] >> GROUP
    seen, ring = np.empty(num_groups, np.int32), np.empty(num_groups, np.float32)
    spoke, scale = np.empty(num_groups, np.float32), np.empty(num_groups, np.float32)
    ring_bits = ring.view(np.int32)
    for p in rows[start:stop]:
        out[p, 0] = out[p, 1] = out[p, 2] = 0
        lobe = lobes.of[material[p]]
        if lobe < 0 or lobes.most[lobe] > 1:
            continue
        nx, ny, nz = normal[p, 0], normal[p, 1], normal[p, 2]
        ox, oy, oz = eye[0] - position[p, 0], eye[1] - position[p, 1], eye[2] - position[p, 2]
        per = np.float32(1) / math.sqrt(max(ox * ox + oy * oy + oz * oz, np.float32(1e-20)))
        ox, oy, oz = per * ox, per * oy, per * oz
        facing: Any = min(max(nx * ox + ny * oy + nz * oz, LEAST_COSINE), np.float32(1))
        row, share = row_of(facing)
        flatness, double = lobes.flatness[lobe], np.float32(2) * facing
        mx, my, mz = double * nx - ox, double * ny - oy, double * nz - oz
        # across the mirror direction, in the plane of n and o
        ex, ey, ez = nx - facing * mx, ny - facing * my, nz - facing * mz
        per = np.float32(1) / math.sqrt(max(ex * ex + ey * ey + ez * ez, np.float32(1e-12)))
        ex, ey, ez = per * ex, per * ey, per * ez
        num = 0
        for byte in range(min(visible.shape[1], (num_groups + 1) >> 1)):
            eight = visible[p, byte]
            if eight & 15:
                seen[num] = 32 * byte + (eight & 15)
                num += 1
            if eight >> 4:
                seen[num] = 32 * byte + 16 + (eight >> 4)
                num += 1
        for k in range(num):  # put side by side: the loop after this one does sixteen at once
            light = seen[k]
            ring[k], spoke[k], scale[k] = lights[light, 0], lights[light, 1], lights[light, 2]
        for k in range(num):
            lx, ly, lz = ring[k], spoke[k], scale[k]
            along, aside = mx * lx + my * ly + mz * lz, ex * lx + ey * ly + ez * lz
            off: Any = min(max(np.float32(2) - np.float32(2) * along, _LEAST), np.float32(4))
            flat = max(off * (np.float32(1) - np.float32(0.25) * off), np.float32(1e-12))
            cosine: Any = min(max(aside / math.sqrt(flat), np.float32(-1)), np.float32(1))
            size = abs(cosine)
            arc = np.float32(-0.0187293) * size + np.float32(0.0742610)  # Abramowitz and Stegun 4.4.45, to 1e-4
            arc = (arc * size - np.float32(0.2121144)) * size + np.float32(1.5707288)
            arc *= math.sqrt(np.float32(1) - size)
            psi = arc if cosine >= 0 else np.float32(math.pi) - arc
            both = max(np.float32(2) + np.float32(2) * (ox * lx + oy * ly + oz * lz), np.float32(1e-6))
            half = (nx * lx + ny * ly + nz * lz + facing) / math.sqrt(both)
            below = max(np.float32(2) - np.float32(2) * half, np.float32(0)) + flatness
            ring[k] = off
            spoke[k] = min(max(psi * _PER_SPOKE - np.float32(0.5), np.float32(0)), _LAST_SPOKE)
            scale[k] = np.float32(1) / (below * below)
        red = green = blue = np.float32(0)
        for k in range(num):
            light = seen[k]
            place: Any = min(np.float32(ring_bits[k] - LEAST_BITS) * _HALF_OCTAVE, _LAST_RING)
            r, s = np.int32(place), np.int32(spoke[k])
            fr, fs = place - np.float32(r), spoke[k] - np.float32(s)
            at = table_of[light] + r * NUM_SPOKES + s
            wa, wb = (np.float32(1) - fr) * (np.float32(1) - fs), (np.float32(1) - fr) * fs
            wc, wd = fr * (np.float32(1) - fs), fr * fs
            a, b, c, d = at, at + 1, at + NUM_SPOKES, at + NUM_SPOKES + 1
            this = wa * shape[lobe, row, a] + wb * shape[lobe, row, b]
            this += wc * shape[lobe, row, c] + wd * shape[lobe, row, d]
            beside = wa * shape[lobe, row + 1, a] + wb * shape[lobe, row + 1, b]
            beside += wc * shape[lobe, row + 1, c] + wd * shape[lobe, row + 1, d]
            sent = scale[k] * (this + share * (beside - this))
            red += sent * lights[light, 3]
            green += sent * lights[light, 4]
            blue += sent * lights[light, 5]
        out[p, 0], out[p, 1], out[p, 2] = red, green, blue


def by_lights(
    surface: Surface,
    visible: NDArray[np.uint8],
    lights: SkyLights,
    lobes: Lobes,
    eye: F32,
    is_needed: NDArray[np.uint8],
) -> F32:
    """Sum the lights that points see in their highlights.

    Args:
        surface: whose points. visible: light l of a point in bit l & 7 of byte l >> 3. (points, bytes) uint8
        lights: of the sky. lobes: of all materials. eye: where it is. (3,) float32
        is_needed: points that are asked; the others get nothing. (points,) uint8
    Returns:
        Σ, of unit albedo, of what neither lobes nor the in-basis are believed. (points, 3) float32
    """
    found = np.zeros((len(visible), 3), np.float32)
    rows = np.flatnonzero(is_needed.view(np.bool_))
    args = surface.points, surface.material, visible, lights, lobes, np.ascontiguousarray(eye, np.float32), rows
    for_shares(lambda start, stop: _sum(*args, start, stop, found), len(rows))
    return found


def by_lights_numpy(
    surface: Surface, visible: NDArray[np.uint8], lights: SkyLights, lobes: Lobes, eye: F32, point: int
) -> F64:
    """Do as `by_lights` for one point with a lobe, in plain NumPy: its oracle.

    Args:
        surface, visible, lights, lobes, eye: as there. point: number of the point.
    Returns:
        (3,) float64
    """
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
    bits = np.unpackbits(visible[point], bitorder="little")[: len(lights.table) // 4]
    nibbles = np.pad(bits, (0, -len(bits) % GROUP)).reshape(-1, GROUP) @ (1 << np.arange(GROUP))
    chosen = (16 * np.arange(len(nibbles)) + nibbles)[nibbles > 0]
    wi, irradiance = np.split(lights.lights[chosen].astype(np.float64), 2, axis=1)
    x = np.clip(2 - 2 * wi @ mirror, rings()[0], 4)
    psi = np.arccos(np.clip(wi @ across / np.sqrt(np.maximum(x * (1 - x / 4), 1e-12)), -1, 1))
    half = (wi @ n + facing) / np.linalg.norm(wi + wo, axis=1)
    ring = np.interp(x, rings(), np.arange(NUM_RINGS))
    spoke = np.clip(psi / np.pi * NUM_SPOKES - 0.5, 0, NUM_SPOKES - 1)
    r, s = np.minimum(ring.astype(int), NUM_RINGS - 2), np.minimum(spoke.astype(int), NUM_SPOKES - 2)
    fr, fs, width = ring - r, spoke - s, lights.table[chosen] // NUM_PLACES
    near = (1 - fs) * table[width, r, s] + fs * table[width, r, s + 1]
    far = (1 - fs) * table[width, r + 1, s] + fs * table[width, r + 1, s + 1]
    sent = ((1 - fr) * near + fr * far) / (np.maximum(2 - 2 * half, 0) + lobes.flatness[lobe]) ** 2
    return np.asarray(sent @ irradiance)
