"""Lights of Blender as lights of a look, and back.

    point, spot    I = P / 4π         W/sr; a spot has the intensity of a point light of its power
    sun            E = P              W/m²
    area           L = P / (π A)      radiance of a one-sided Lambertian emitter

Cycles uses these units. A spot's edge is a smoothstep of cos θ in Blender and a square in relume: both have the same
flux if the square's range of cosines is three quarters as wide. Coordinates: Blender has +Z up, looks +Y.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Look = Mapping[str, Any]

KINDS = {"POINT": "point", "SPOT": "spot", "SUN": "directional", "AREA": "rectangle"}
_TYPES = {kind: name for name, kind in KINDS.items()} | {"disc": "AREA", "sphere": "POINT", "tube": "POINT"}
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From Blender's axes to those of looks and glTF."""
_EDGE = 0.75
_VERTICAL = 1 - 1e-6
_TOLERANCE = 1e-5


@dataclass(frozen=True)
class BlenderLight:
    """A light object of Blender.

    Attributes:
        type: POINT, SPOT, SUN or AREA.
        power: W, of a sun W/m². color: linear, its largest channel need not be 1.
        to_world: Blender's world axes, rigid; it emits along −Z. (4, 4)
        spot_size: full angle, radians. spot_blend: 0 to 1.
        size: width and height of an area light in its own X and Y, meters. is_round: an ellipse in this box.
    """

    type: str
    power: float
    color: tuple[float, float, float]
    to_world: F64
    spot_size: float = 0.0
    spot_blend: float = 0.0
    size: tuple[float, float] = (0.0, 0.0)
    is_round: bool = False


def to_look(light: BlenderLight, *, enabled: bool = True) -> dict[str, Any]:
    """Return the light of a look. An ellipse becomes a rectangle of its area and its proportions."""
    direction = -(Y_UP @ light.to_world[:3, 2])
    document: dict[str, Any] = {
        "kind": KINDS[light.type],
        "intensity": 1.0,
        "color": [*light.color],
        "enabled": enabled,
        "position": _plain(Y_UP @ light.to_world[:3, 3]),
        "direction": _plain(direction),
    }
    if light.type == "AREA":
        scale = math.sqrt(math.pi) / 2 if light.is_round else 1.0
        width, height = (max(side * scale, 1e-8) for side in light.size)
        horizontal, up = _rectangle_axes(direction)
        height_axis = Y_UP @ light.to_world[:3, 1]
        rotation = math.degrees(math.atan2(-height_axis @ horizontal, height_axis @ up))
        document |= {"size": [width, height], "rotation": rotation}
        strength = light.power / (math.pi * width * height)
    else:
        strength = light.power / (1.0 if light.type == "SUN" else 4 * math.pi)
    if light.type == "SPOT":
        outer = min(light.spot_size / 2, math.pi / 2)
        inner = math.acos(math.cos(outer) + _EDGE * light.spot_blend * (1 - math.cos(outer)))
        document["cone"] = [math.degrees(inner), math.degrees(outer)]
    for name in {"POINT": ("direction",), "SUN": ("position",)}.get(light.type, ()):
        del document[name]
    return {**document, "emission": [strength] * 3}


def from_look(light: Look) -> BlenderLight:
    """Return the light of Blender for a complete light of a look other than an emissive mesh.

    A disc becomes a square of its area, a sphere or a tube a point light of its power.
    """
    type_ = _TYPES[light["kind"]]
    gain = [light["intensity"] * c * e for c, e in zip(light["color"], light["emission"], strict=True)]
    strength = max(gain)
    color = tuple(channel / strength for channel in gain) if strength > 0 else (1.0, 1.0, 1.0)
    direction = np.array(light.get("direction", (0.0, -1.0, 0.0)), np.float64)
    direction /= np.linalg.norm(direction)
    horizontal, up = _rectangle_axes(direction)
    angle = math.radians(light.get("rotation", 0.0))
    height_axis = math.cos(angle) * up - math.sin(angle) * horizontal
    to_world = np.eye(4)
    to_world[:3, 1], to_world[:3, 2] = Y_UP.T @ height_axis, -(Y_UP.T @ direction)
    to_world[:3, 0] = np.cross(to_world[:3, 1], to_world[:3, 2])
    to_world[:3, 3] = Y_UP.T @ np.array(light.get("position", (0.0, 0.0, 0.0)))
    radius = light.get("radius", 0.0)
    width, height = light.get("size", (math.sqrt(math.pi) * radius,) * 2)
    point_scale = {"sphere": 4 * (math.pi * radius) ** 2, "tube": 2 * math.pi**2 * radius * light.get("length", 0.0)}
    scale = {"AREA": math.pi * width * height, "SUN": 1.0}.get(type_, point_scale.get(light["kind"], 4 * math.pi))
    inner, outer = (math.radians(angle) for angle in light.get("cone", (0.0, 0.0)))
    blend = (math.cos(inner) - math.cos(outer)) / (_EDGE * (1 - math.cos(outer))) if outer > 0 else 0.0
    return BlenderLight(
        type_,
        strength * scale,
        color,
        to_world,
        2 * outer,
        min(max(blend, 0.0), 1.0),
        (width, height),
    )


def changed_fields(before: BlenderLight, after: BlenderLight) -> set[str]:
    """Names of the fields of a light that differ."""
    pairs = ((field.name, getattr(before, field.name), getattr(after, field.name)) for field in fields(BlenderLight))
    return {
        name
        for name, old, new in pairs
        if (old != new if isinstance(old, str) else not np.allclose(old, new, rtol=_TOLERANCE, atol=_TOLERANCE))
    }


def _rectangle_axes(direction: F64) -> tuple[F64, F64]:
    """Horizontal and vertical axis of a rectangle of a look without rotation."""
    hint = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < _VERTICAL else np.array([0.0, 0.0, 1.0])
    up = hint - (hint @ direction) * direction
    up /= np.linalg.norm(up)
    return np.cross(up, direction), up


def _plain(vector: Sequence[float] | F64) -> list[float]:
    return [float(value) for value in vector]
