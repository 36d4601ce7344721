"""MERL .binary: isotropic BRDFs measured over half and difference angles (Matusik 2003, Rusinkiewicz 1998).

A header of three int32 (90, 90, 180), then planes R, G, B of float64 over (θh, θd, φd), little-endian. Node k of an
axis is at θh = (k/90)² π/2, θd = k/90 · π/2, φd = k/180 · π: half angles are dense near highlights. φd ends at π, since
exchanging light and view adds π to it. Stored values times `CHANNEL_SCALE` are 1/sr; negative values were not measured
(one of the directions is below the horizon).
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import MaterialError
from relume.core.filesystem import atomic_write

F64 = NDArray[np.float64]

SHAPE = (90, 90, 180)
CHANNEL_SCALE = np.array([1.0, 1.15, 1.66]) / 1500.0
NOT_MEASURED = -1.0
MAX_VALUE = 1e6
_HEADER = struct.Struct("<3i")
FILE_BYTES = _HEADER.size + 3 * math.prod(SHAPE) * 8


def read_merl(path: Path, file_name: str | None = None) -> Shaped[F64, "3 90 90 180"]:
    """Read the planes of a file without conversion.

    Args:
        file_name: file name in errors; None for the name in the path.
    Returns:
        Finite values, negative if not measured.
    Raises:
        MaterialError: the file has another size or header, a value that is not finite or above 10⁶ per steradian, or no
            measured value.
    """
    label = file_name or path.name
    with path.open("rb") as file:
        header = file.read(_HEADER.size)
        size = path.stat().st_size
        if len(header) < _HEADER.size or _HEADER.unpack(header) != SHAPE:
            raise MaterialError(
                f"{label} is not a MERL file: it does not start with 90, 90, 180; give a .binary, .bsdf or .brdf"
            )
        if size != FILE_BYTES:
            raise MaterialError(f"{label} has {size:,} bytes, a MERL file {FILE_BYTES:,}; download it again")
        planes = np.fromfile(file, "<f8").reshape(3, *SHAPE).astype(np.float64, copy=False)
    if not np.isfinite(planes).all():
        raise MaterialError(f"{label} has non-finite values; download it again")
    if float((planes.max(axis=(1, 2, 3)) * CHANNEL_SCALE).max()) > MAX_VALUE:
        raise MaterialError(f"{label} has values above {MAX_VALUE:g} per steradian; no material reflects that much")
    if not is_measured(planes).any():
        raise MaterialError(f"{label} has no measured value; give another file")
    return planes


def write_merl(path: Path, planes: Shaped[F64, "3 90 90 180"]) -> None:
    """Write a file atomically; `read_merl` returns the same bits."""
    with atomic_write(path) as unfinished, unfinished.open("wb") as file:
        file.write(_HEADER.pack(*SHAPE))
        file.write(np.ascontiguousarray(planes, "<f8").data)


def is_measured(planes: Shaped[F64, "3 90 90 180"]) -> Shaped[NDArray[np.bool_], "90 90 180"]:
    """True at nodes where all three channels were measured."""
    return np.asarray(np.all(planes >= 0.0, axis=0))


def grid_angles() -> tuple[Shaped[F64, "90 1 1"], Shaped[F64, "90 1"], Shaped[F64, " 180"]]:
    """θh, θd and φd of the nodes, radians; they broadcast."""
    theta_h, theta_d, phi_d = (np.arange(n) / n for n in SHAPE)
    half_pi = math.pi / 2
    return (theta_h**2 * half_pi)[:, None, None], (theta_d * half_pi)[:, None], phi_d * math.pi


def grid_directions() -> tuple[Shaped[F64, "90 90 180 3"], Shaped[F64, "90 90 180 3"]]:
    """wi and wo of all nodes, local frame, with azimuth zero of the half vector; some are below the horizon."""
    theta_h, theta_d, phi_d = grid_angles()
    along, across = np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d)
    up = np.cos(theta_d)
    cos_h, sin_h = np.cos(theta_h), np.sin(theta_h)
    wi, wo = (
        np.stack(np.broadcast_arrays(cos_h * s * along + sin_h * up, s * across, cos_h * up - sin_h * s * along), -1)
        for s in (1.0, -1.0)
    )
    return wi, wo
