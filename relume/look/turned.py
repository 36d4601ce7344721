"""Looks whose light stands elsewhere: turned about an upright line, as it is seen from a turntable."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

_VERTICAL = 2e-6  # of a direction's square, off the upright line: as `relume.light.local.rectangle` has it


def with_turned_sky(document: Mapping[str, Any], degrees: float) -> dict[str, Any]:
    """A look whose environment is turned further about +Y, counter-clockwise seen from above.

    Args:
        document: a complete look. degrees: any number.
    """
    environment = document["environment"]
    return {**document, "environment": {**environment, "rotation": _half_turn(environment["rotation"] + degrees)}}


def with_turned_light(document: Mapping[str, Any], degrees: float, middle: Sequence[float]) -> dict[str, Any]:
    """A look whose environment and lamps are turned about an upright line; surfaces that shine stay where they are.

    Args:
        document: a complete look. degrees: counter-clockwise seen from above. middle: a place on that line, metres.
    """
    lights = {name: _turned_lamp(light, degrees, middle) for name, light in document["lights"].items()}
    return {**with_turned_sky(document, degrees), "lights": lights}


def _turned_lamp(light: Mapping[str, Any], degrees: float, middle: Sequence[float]) -> dict[str, Any]:
    found = dict(light)
    if "position" in light:
        offset = [at - about for at, about in zip(light["position"], middle, strict=True)]
        found["position"] = [about + at for about, at in zip(middle, _turned(offset, degrees), strict=True)]
    if "direction" in light:
        found["direction"] = _turned(light["direction"], degrees)
        x, y, z = light["direction"]
        if "rotation" in light and x * x + z * z < _VERTICAL * y * y:  # its height then lies along z, which turns not
            found["rotation"] = _half_turn(light["rotation"] + (degrees if y > 0 else -degrees))
    return found


def _turned(vector: Sequence[float], degrees: float) -> list[float]:
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x, y, z = vector
    return [cosine * x + sine * z, y, cosine * z - sine * x]


def _half_turn(degrees: float) -> float:
    """The same angle as sliders have it, in [-180, 180)."""
    return (degrees + 180) % 360 - 180
