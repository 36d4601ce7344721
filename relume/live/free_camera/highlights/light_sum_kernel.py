"""Environment highlights of probes, summed over visible environment triangles.

    B / a = (1 − β) (L_2 / a) + Σ_l V_l E_l T(x_l, ψ_l) / (x_h + α²)²

T is a table of the highlight (`relume.live.free_camera.basis.lobe_shapes`), V_l a visibility bit. The approximations
are the shape of the table and that of lights: each has the direction and width of its triangle, and four adjacent
triangles count as one light if several are visible, with the mean direction and the spread of the visible ones.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.basis.highlight_lobes import Lobes
from relume.live.free_camera.basis.lobe_shapes import (
    MIN_EXPONENT,
    NUM_AZIMUTHS,
    NUM_GRID_DIRECTIONS,
    NUM_RINGS,
    WIDTHS,
)
from relume.live.free_camera.basis.table_index import MIN_COSINE, table_row
from relume.probes.stored_scene import ViewedProbes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

LIGHTS_PER_GROUP = 4  # adjacent lights that are merged if several are visible
_MIN_SQUARED_DISTANCE = np.float32(2.0**MIN_EXPONENT)
LEAST_BITS = np.int32(np.float32(_MIN_SQUARED_DISTANCE).view(np.int32))
_HALF_OCTAVE = np.float32(2.0**-22)  # of bits of a float: one ring
_LAST_RING, _LAST_AZIMUTH = np.float32(NUM_RINGS - 1.001), np.float32(NUM_AZIMUTHS - 1.001)
_RADIUS_TO_VARIANCE = 8.0  # a triangle's r² over that of the circle about it: of an equilateral one, along an axis
_AZIMUTHS_PER_RADIAN = np.float32(NUM_AZIMUTHS / math.pi)


class EnvironmentLights(NamedTuple):
    """The environment triangles, in groups: one light for each combination of visible triangles in a group.

    Attributes:
        lights: lights of each combination the mean direction, unit, then Σ E per channel.
        table: start of the table of its width.
    """

    lights: Shaped[F32, "combinations 6"]
    table: Shaped[NDArray[np.int32], " combinations"]

    @classmethod
    def from_lights(
        cls, directions: Shaped[F32, "lights 3"], irradiance: Shaped[F32, "lights 3"], radius: Shaped[F32, " lights"]
    ) -> EnvironmentLights:
        """Group successive lights.

        Args:
            directions, irradiance: directions and irradiance of each light, adjacent lights in succession.
            radius: radius of a circle about each, radians.
        """
        num_rows = -(-len(directions) // LIGHTS_PER_GROUP) * LIGHTS_PER_GROUP
        rows = np.zeros((num_rows, 7))
        rows[: len(directions)] = np.column_stack([directions, irradiance, np.square(radius) / _RADIUS_TO_VARIANCE])
        towards, light, spread = np.split(rows.reshape(-1, 1, LIGHTS_PER_GROUP, 7), [3, 6], axis=-1)
        is_in = (np.arange(2**LIGHTS_PER_GROUP)[:, None] >> np.arange(LIGHTS_PER_GROUP)) & 1
        weight = is_in * np.maximum(light.max(axis=-1), 1e-30)
        weight /= np.maximum(weight.sum(axis=-1, keepdims=True), 1e-30)
        mean = np.einsum("gmk,gmkc->gmc", weight, np.broadcast_to(towards, (*weight.shape, 3)))
        length = np.linalg.norm(mean, axis=-1)
        variance = (weight * spread[..., 0]).sum(axis=-1) + 1 - length
        mean /= np.maximum(length, 1e-30)[..., None]
        lights = np.concatenate([mean, (is_in[..., None] * light).sum(axis=2)], axis=-1)
        table = np.searchsorted(np.multiply(WIDTHS[1:], WIDTHS[:-1]), variance) * NUM_GRID_DIRECTIONS
        return cls(lights.reshape(-1, 6).astype(np.float32), table.ravel().astype(np.int32))


# One function: arrays passed to functions, even inlined ones, are reference-counted, for every probe.
@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _sum_lights(viewed, visibility_bits, environment_lights, lobes, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the lights of probes rows[start:stop]. out: (probes, 3), written there"""
    (position, normal, _, _, _), material, camera_position, rows = viewed
    lights, table_start = environment_lights
    shape = lobes.shape.reshape(lobes.shape.shape[0], lobes.shape.shape[1], lobes.shape.shape[2] * NUM_GRID_DIRECTIONS)
    num_groups = lights.shape[0] >> LIGHTS_PER_GROUP
    visible_lights, ring = np.empty(num_groups, np.int32), np.empty(num_groups, np.float32)
    azimuth, scale = np.empty(num_groups, np.float32), np.empty(num_groups, np.float32)
    ring_bits = ring.view(np.int32)
    for p in rows[start:stop]:
        out[p, 0] = out[p, 1] = out[p, 2] = 0
        lobe = lobes.lobe_index[material[p]]
        if lobe < 0 or lobes.max_ratio[lobe] > 1:
            continue
        nx, ny, nz = normal[p, 0], normal[p, 1], normal[p, 2]
        ox, oy, oz = (
            camera_position[0] - position[p, 0],
            camera_position[1] - position[p, 1],
            camera_position[2] - position[p, 2],
        )
        inverse_length = np.float32(1) / math.sqrt(max(ox * ox + oy * oy + oz * oz, np.float32(1e-20)))
        ox, oy, oz = inverse_length * ox, inverse_length * oy, inverse_length * oz
        facing = min(max(nx * ox + ny * oy + nz * oz, MIN_COSINE), np.float32(1))
        row, fraction = table_row(facing)
        flatness, double = lobes.flatness[lobe], np.float32(2) * facing
        mx, my, mz = double * nx - ox, double * ny - oy, double * nz - oz
        # perpendicular to the mirror direction, in the plane of n and o
        ex, ey, ez = nx - facing * mx, ny - facing * my, nz - facing * mz
        inverse_length = np.float32(1) / math.sqrt(max(ex * ex + ey * ey + ez * ez, np.float32(1e-12)))
        ex, ey, ez = inverse_length * ex, inverse_length * ey, inverse_length * ez
        num = 0
        for byte in range(min(visibility_bits.shape[1], (num_groups + 1) >> 1)):
            byte_value = visibility_bits[p, byte]
            if byte_value & 15:
                visible_lights[num] = 32 * byte + (byte_value & 15)
                num += 1
            if byte_value >> 4:
                visible_lights[num] = 32 * byte + 16 + (byte_value >> 4)
                num += 1
        for k in range(num):  # contiguous, so that the next loop vectorizes
            light = visible_lights[k]
            ring[k], azimuth[k], scale[k] = lights[light, 0], lights[light, 1], lights[light, 2]
        for k in range(num):
            lx, ly, lz = ring[k], azimuth[k], scale[k]
            mirror_cosine, cross_component = mx * lx + my * ly + mz * lz, ex * lx + ey * ly + ez * lz
            squared_distance = min(
                max(np.float32(2) - np.float32(2) * mirror_cosine, _MIN_SQUARED_DISTANCE), np.float32(4)
            )
            squared_sine = max(
                squared_distance * (np.float32(1) - np.float32(0.25) * squared_distance), np.float32(1e-12)
            )
            cosine = min(max(cross_component / math.sqrt(squared_sine), np.float32(-1)), np.float32(1))
            size = abs(cosine)
            arc = np.float32(-0.0187293) * size + np.float32(0.0742610)  # Abramowitz and Stegun 4.4.45, to 1e-4
            arc = (arc * size - np.float32(0.2121144)) * size + np.float32(1.5707288)
            arc *= math.sqrt(np.float32(1) - size)
            psi = arc if cosine >= 0 else np.float32(math.pi) - arc
            half_squared = max(np.float32(2) + np.float32(2) * (ox * lx + oy * ly + oz * lz), np.float32(1e-6))
            half = (nx * lx + ny * ly + nz * lz + facing) / math.sqrt(half_squared)
            denominator = max(np.float32(2) - np.float32(2) * half, np.float32(0)) + flatness
            ring[k] = squared_distance
            azimuth[k] = min(max(psi * _AZIMUTHS_PER_RADIAN - np.float32(0.5), np.float32(0)), _LAST_AZIMUTH)
            scale[k] = np.float32(1) / (denominator * denominator)
        red = green = blue = np.float32(0)
        for k in range(num):
            light = visible_lights[k]
            ring_coordinate = min(np.float32(ring_bits[k] - LEAST_BITS) * _HALF_OCTAVE, _LAST_RING)
            r, s = np.int32(ring_coordinate), np.int32(azimuth[k])
            fr, fs = ring_coordinate - np.float32(r), azimuth[k] - np.float32(s)
            at = table_start[light] + r * NUM_AZIMUTHS + s
            wa, wb = (np.float32(1) - fr) * (np.float32(1) - fs), (np.float32(1) - fr) * fs
            wc, wd = fr * (np.float32(1) - fs), fr * fs
            a, b, c, d = at, at + 1, at + NUM_AZIMUTHS, at + NUM_AZIMUTHS + 1
            lower = wa * shape[lobe, row, a] + wb * shape[lobe, row, b]
            lower += wc * shape[lobe, row, c] + wd * shape[lobe, row, d]
            upper = wa * shape[lobe, row + 1, a] + wb * shape[lobe, row + 1, b]
            upper += wc * shape[lobe, row + 1, c] + wd * shape[lobe, row + 1, d]
            value = scale[k] * (lower + fraction * (upper - lower))
            red += value * lights[light, 3]
            green += value * lights[light, 4]
            blue += value * lights[light, 5]
        out[p, 0], out[p, 1], out[p, 2] = red, green, blue


def sum_lights(
    viewed: ViewedProbes,
    visibility_bits: Shaped[NDArray[np.uint8], "probes bytes"],
    lights: EnvironmentLights,
    lobes: Lobes,
) -> Shaped[F32, "probes 3"]:
    """Sum the visible lights in highlights of probes.

    Args:
        viewed: the probes to evaluate; the others get zero. lights: of the environment. lobes: of all materials.
        visibility_bits: light l of a probe in bit l & 7 of byte l >> 3.
    Returns:
        Σ for unit albedo, without the fractions of lobes; zero if the basis represents the highlight.
    """
    sums = np.zeros((len(visibility_bits), 3), np.float32)
    args = viewed, visibility_bits, lights, lobes
    parallel_for_chunks(lambda start, stop: _sum_lights(*args, start, stop, sums), len(viewed.rows))
    return sums
