"""Thin lens of a camera: depth of field.

A camera with a lens of radius r, focused at the depth f, images a point at the depth z as a disk, the circle of
confusion; its diameter, as a fraction of the image plane at unit distance, is

    c(z) = 2 r |1/z − 1/f| .

Depths are along the camera's axis. An ideal lens loses no light: the brightness of an image does not depend on r.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ParameterError
from relume.core.validation import is_number

F64 = NDArray[np.float64]

MAX_RADIUS = 10.0  # meters
MIN_FOCUS_DISTANCE, MAX_FOCUS_DISTANCE = 1e-3, 1e6  # meters
MIN_BLADES, MAX_BLADES = 3, 16
_FIELDS, _OPTIONAL_FIELD = ("radius", "focus_distance"), "blades"


@dataclass(frozen=True)
class Lens:
    """A thin lens, made by `make_lens`.

    Attributes:
        radius: of the aperture, meters; of a polygon to its corners.
        focus_distance: depth that is sharp, meters.
        blades: corners of the aperture, the first upward; 0: a disk.
    """

    radius: float
    focus_distance: float
    blades: int = 0

    def document(self) -> dict[str, Any]:
        """Convert to JSON; the inverse of `read_lens`."""
        blades = {"blades": self.blades} if self.blades else {}
        return {"radius": self.radius, "focus_distance": self.focus_distance} | blades

    def scaled(self, factor: float) -> Lens:
        """The lens in a scene that is scaled by a factor, within the limits of `make_lens`."""
        focus_distance = min(max(factor * self.focus_distance, MIN_FOCUS_DISTANCE), MAX_FOCUS_DISTANCE)
        return Lens(min(factor * self.radius, MAX_RADIUS), focus_distance, self.blades)

    def circle_of_confusion(self, depth: Shaped[NDArray[np.floating], " n"]) -> Shaped[F64, " n"]:
        """Diameter of the image of a point, on the image plane at unit distance. depth: meters, may be infinite"""
        return np.asarray(2 * self.radius * np.abs(1 / np.asarray(depth, np.float64) - 1 / self.focus_distance))

    def points(self, u: Shaped[F64, "n 2"]) -> Shaped[F64, "n 2"]:
        """Map numbers in [0, 1) to points of the aperture, uniformly by area: right and up, meters."""
        return self.radius * (_polygon(u, self.blades) if self.blades else _disk(u))


def make_lens(radius: float, focus_distance: float, blades: int = 0) -> Lens:
    """Validate a lens.

    Args:
        radius, focus_distance, blades: see `Lens`.
    Raises:
        ParameterError: a value is out of range.
    """
    if not 0 < radius <= MAX_RADIUS:
        raise ParameterError("radius", radius, f"an aperture of more than 0 and at most {MAX_RADIUS:g} m, or no lens")
    if not MIN_FOCUS_DISTANCE <= focus_distance <= MAX_FOCUS_DISTANCE:
        raise ParameterError("focus_distance", focus_distance, f"{MIN_FOCUS_DISTANCE:g} to {MAX_FOCUS_DISTANCE:,.0f} m")
    if blades and not MIN_BLADES <= blades <= MAX_BLADES:
        raise ParameterError("blades", blades, f"{MIN_BLADES} to {MAX_BLADES} blades, or 0 for a round aperture")
    return Lens(float(radius), float(focus_distance), int(blades))


def read_lens(document: object) -> Lens:
    """Read the lens of a JSON document. Raises ParameterError."""
    if not isinstance(document, Mapping) or set(document) - {_OPTIONAL_FIELD} != set(_FIELDS):
        raise ParameterError("lens", document, "an object with " + ", ".join(_FIELDS) + ", and perhaps blades")
    for field in _FIELDS:
        if not is_number(document[field]):
            raise ParameterError(field, document[field], "a number of meters")
    blades = document.get(_OPTIONAL_FIELD, 0)
    if not isinstance(blades, int) or isinstance(blades, bool):
        raise ParameterError("blades", blades, "a whole number")
    return make_lens(document["radius"], document["focus_distance"], blades)


def _disk(u: F64) -> F64:
    """Concentric map of the square to the unit disk (Shirley and Chiu 1997)."""
    x, y = 2 * u.T - 1
    is_wide = np.abs(x) > np.abs(y)
    radius = np.where(is_wide, x, y)
    ratio = np.where(is_wide, y, x) / np.where(radius == 0, 1, radius)
    angle = np.where(is_wide, math.pi / 4 * ratio, math.pi / 2 - math.pi / 4 * ratio)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _polygon(u: F64, num_corners: int) -> F64:
    """Map the square to a regular polygon, whose corners are on the unit circle: a triangle for each side."""
    scaled = u[:, 0] * num_corners
    side = np.floor(scaled)
    to_edge, along = np.sqrt(u[:, 1])[:, None], (scaled - side)[:, None]

    def corner(index: F64) -> F64:
        angle = math.pi / 2 + 2 * math.pi * index / num_corners
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)

    return np.asarray(to_edge * ((1 - along) * corner(side) + along * corner(side + 1)))
