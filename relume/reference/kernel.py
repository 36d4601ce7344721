"""Sums over lights at one point, in float64: the loops of the reference.

They share no code with the operators: directions, angles and curves are evaluated per texel, at full precision.
"""

from __future__ import annotations

import math

import numba as nb

from relume.brdf.term import Angle
from relume.core.numba_options import NO_REFCOUNT

_THETA_I, _THETA_H, _THETA_D = int(Angle.THETA_I), int(Angle.THETA_H), int(Angle.THETA_D)
_THETA_R, _ALPHA, _LOBE = int(Angle.THETA_R), int(Angle.ALPHA), int(Angle.LOBE)
_TILT_X, _TILT_Y = int(Angle.TILT_X), int(Angle.TILT_Y)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def list_visible(normal, tangent, wo, visible, directions, wi, light):  # type: ignore[no-untyped-def]
    """Directions of the lights that are visible from a point, in its frame x = tangent, y = n × t, z = n.

    Args:
        normal, tangent, wo: world space. (3,) float64. visible: bits. (bytes,) uint8. directions: (m, 3) float64
        wi: (3, ≥ m), output. light: (≥ m,) int64, output.
    Returns:
        Number of lights, and wo in the frame, three floats.
    """
    bx = normal[1] * tangent[2] - normal[2] * tangent[1]
    by = normal[2] * tangent[0] - normal[0] * tangent[2]
    bz = normal[0] * tangent[1] - normal[1] * tangent[0]
    num = 0
    for m in range(directions.shape[0]):
        if (visible[m >> 3] >> (m & 7)) & 1 == 0:
            continue
        x, y, z = directions[m, 0], directions[m, 1], directions[m, 2]
        cosine = normal[0] * x + normal[1] * y + normal[2] * z
        if cosine <= 0:  # in float32 it was slightly above the horizon
            continue
        wi[0, num] = tangent[0] * x + tangent[1] * y + tangent[2] * z
        wi[1, num] = bx * x + by * y + bz * z
        wi[2, num] = cosine
        light[num] = m
        num += 1
    ox = tangent[0] * wo[0] + tangent[1] * wo[1] + tangent[2] * wo[2]
    oy = bx * wo[0] + by * wo[1] + bz * wo[2]
    oz = normal[0] * wo[0] + normal[1] * wo[1] + normal[2] * wo[2]
    return num, ox, oy, oz


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _angle(kind, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """γ in radians, as `relume.brdf.evaluate.angles_numpy` defines it; wo is multiplied by the curve's axes."""
    if kind == _THETA_I:
        return math.acos(min(max(iz, 0.0), 1.0))
    if kind == _THETA_R:
        return math.acos(min(max(iz * oz - ix * ox - iy * oy, 0.0), 1.0))
    if kind == _LOBE:
        return math.acos(min(max(ix * ox + iy * oy + iz * oz, 0.0), 1.0))
    hx, hy, hz = ix + ox, iy + oy, iz + oz
    if kind == _TILT_X:
        return math.atan2(abs(hx), max(hz, 0.0))
    if kind == _TILT_Y:
        return math.atan2(abs(hy), max(hz, 0.0))
    length = max(math.sqrt(hx * hx + hy * hy + hz * hz), 1e-300)
    if kind == _THETA_D:
        return math.acos(min(max((hx * ix + hy * iy + hz * iz) / length, 0.0), 1.0))
    cos_theta_h = min(max(hz / length, 0.0), 1.0)
    if kind == _THETA_H:
        return math.acos(cos_theta_h)
    cos_phi_h = math.cos(math.atan2(hy, hx))
    power = cos_phi_h * cos_phi_h if kind == _ALPHA else 1.0 - cos_phi_h * cos_phi_h
    return math.acos(cos_theta_h**power)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _read(table, position, is_stepped):  # type: ignore[no-untyped-def]
    """Look up a table at a fractional index: linear between entries, or constant up to the next one."""
    step = min(int(position), table.shape[0] - 2)
    if is_stepped:
        return table[step]
    upper = position - step
    return (1.0 - upper) * table[step] + upper * table[step + 1]


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def add_lights(angles, axes, tables, is_stepped, is_gray, light, num, wi, ox, oy, oz, shading, power, out):  # type: ignore[no-untyped-def]
    """Add Σ power · shading · Π curves over the listed lights, per channel, to out (3,).

    Args:
        angles, axes: `Curve.angle` and `Curve.axes` of each curve. (C,) int64, (C, 3) float64
        tables: each curve at equal steps over [0, π/2]. (C, 3, steps + 1) float64
        is_stepped: the curve is constant between entries, else linear. (C, 3) bool
        is_gray: the curve is the same in all channels. (C,) bool
        light: rows of `power` for the first `num` listed lights. (≥ num,) int64
        wi: directions toward these lights, local frame, unit. (3, ≥ num) float64
        ox, oy, oz: direction toward the viewer, local frame, unit.
        shading: quotient · cos θi, one for all channels or three. (1 or 3, ≥ num) float64. power: (m, 3) float64
    """
    blue_row = shading.shape[0] - 1
    scale = (tables.shape[2] - 1) / (math.pi / 2)
    red = green = blue = 0.0
    for n in range(num):
        r, g, b = shading[0, n], shading[blue_row // 2, n], shading[blue_row, n]
        if r == 0.0 and g == 0.0 and b == 0.0:
            continue
        for k in range(angles.shape[0]):
            x, y, z = axes[k, 0] * ox, axes[k, 1] * oy, axes[k, 2] * oz
            position = _angle(angles[k], wi[0, n], wi[1, n], wi[2, n], x, y, z) * scale
            value = _read(tables[k, 0], position, is_stepped[k, 0])
            r *= value
            g *= value if is_gray[k] else _read(tables[k, 1], position, is_stepped[k, 1])
            b *= value if is_gray[k] else _read(tables[k, 2], position, is_stepped[k, 2])
        red += r * power[light[n], 0]
        green += g * power[light[n], 1]
        blue += b * power[light[n], 2]
    out[0] += red
    out[1] += green
    out[2] += blue
