"""The file's cameras under URL-safe names, or a camera that frames the whole scene.

glTF 2.0 specification, section 3.10.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.math.bounding_box import box_corners
from relume.scene.model import Camera, Mesh
from relume.scene.unique_names import append_number

F64 = NDArray[np.float64]
FRAMING_YFOV = float(np.radians(30.0))
FRAMING_ASPECT = 4 / 3
FRAMING_MARGIN = 1.08


def make_slug(preferred: str, used_names: dict[str, int]) -> str:
    """Return an unused name of [a-z0-9-]{1,40} and add it to `used_names`."""
    ascii_name = unicodedata.normalize("NFKD", preferred[:200]).encode("ascii", "ignore").decode().lower()
    plain = re.sub(r"[^a-z0-9]+", "-", ascii_name).strip("-")[:34].strip("-") or "view"
    return append_number(plain, "-", used_names)


def rigid_frame(to_world: Shaped[F64, "4 4"]) -> Shaped[F64, "4 4"] | None:
    """Remove scale and shear; position, -Z and the up side stay. None for a degenerate frame."""
    backward, up = to_world[:3, 2], to_world[:3, 1]
    right = np.cross(up, backward)
    lengths = np.linalg.norm(backward), np.linalg.norm(right)
    if min(lengths) < 1e-12:
        return None
    z, x = backward / lengths[0], right / lengths[1]
    frame = np.eye(4)
    frame[:3] = np.column_stack([x, np.cross(z, x), z, to_world[:3, 3]])
    return frame


def framing_camera(meshes: Sequence[Mesh], name: str) -> Camera:
    """Return a three-quarter view, slightly from above, that frames all vertices in a 4:3 image."""
    points = np.concatenate([_extremes(mesh.positions) for mesh in meshes]).astype(np.float64)
    lowest, highest = points.min(0), points.max(0)
    center = (lowest + highest) / 2
    azimuth, elevation = np.radians(30.0), np.radians(20.0)
    backward = np.array([np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)])
    right = np.cross([0.0, 1.0, 0.0], backward)
    right /= np.linalg.norm(right)
    up = np.cross(backward, right)
    x, y, z = (points - center) @ right, (points - center) @ up, (points - center) @ backward
    tangent = np.tan(FRAMING_YFOV / 2) / FRAMING_MARGIN
    distance = max(float((z + np.abs(y) / tangent).max()), float((z + np.abs(x) / (tangent * FRAMING_ASPECT)).max()))
    distance = max(distance, float(np.linalg.norm(highest - lowest)), 1e-6)
    to_world = np.eye(4)
    to_world[:3] = np.column_stack([right, up, backward, center + distance * backward])
    return Camera(name, to_world, FRAMING_YFOV)


def _extremes(positions: NDArray[np.float32]) -> NDArray[np.float32]:
    """Points to frame: the vertices, or for a large mesh the corners of its bounding box."""
    if len(positions) <= 100_000:
        return positions
    return box_corners(positions)
