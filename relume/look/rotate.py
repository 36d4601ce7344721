"""Looks with rotated environment and lights, for turntables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

_VERTICAL = 2e-6  # horizontal part of a squared direction, as in `relume.lights.local_lights.rectangle`


def rotated_environment(document: Mapping[str, Any], degrees: float) -> dict[str, Any]:
    """Rotate the environment of a look about +Y, counterclockwise from above.

    Args:
        document: a complete look. degrees: any number.
    """
    environment = document["environment"]
    return {**document, "environment": {**environment, "rotation": _wrap_degrees(environment["rotation"] + degrees)}}


def rotated_lights(document: Mapping[str, Any], degrees: float, center: Sequence[float]) -> dict[str, Any]:
    """Rotate the environment and the lights of a look about a vertical axis; emissive meshes stay in place.

    Args:
        document: a complete look. degrees: counterclockwise from above. center: a point on the axis, meters.
    """
    lights = {name: _rotate_light(light, degrees, center) for name, light in document["lights"].items()}
    return {**rotated_environment(document, degrees), "lights": lights}


def _rotate_light(light: Mapping[str, Any], degrees: float, center: Sequence[float]) -> dict[str, Any]:
    rotated = dict(light)
    if "position" in light:
        offset = [coordinate - origin for coordinate, origin in zip(light["position"], center, strict=True)]
        rotated["position"] = [
            origin + coordinate for origin, coordinate in zip(center, _rotate_vector(offset, degrees), strict=True)
        ]
    if "direction" in light:
        rotated["direction"] = _rotate_vector(light["direction"], degrees)
        x, y, z = light["direction"]
        if "rotation" in light and x * x + z * z < _VERTICAL * y * y:  # its height is then along z, which is fixed
            rotated["rotation"] = _wrap_degrees(light["rotation"] + (degrees if y > 0 else -degrees))
    return rotated


def _rotate_vector(vector: Sequence[float], degrees: float) -> list[float]:
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x, y, z = vector
    return [cosine * x + sine * z, y, cosine * z - sine * x]


def _wrap_degrees(degrees: float) -> float:
    """Wrap an angle to the range of sliders, [-180, 180)."""
    return (degrees + 180) % 360 - 180
