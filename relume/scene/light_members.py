"""Lights of a file that are one source: their places, shapes and relative emission, one row each.

Kind "points" has point and spot lights, "panels" area lights, "directionals" directional lights. The look sets what all
of them emit, their mean; a row has the emission of one relative to it. Emissive materials need no rows: the source of
kind "surfaces" names them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError

F32 = NDArray[np.float32]

NUM_COLUMNS = 16
MAX_MEMBERS = 100_000  # of a scene
MEMBER_KINDS = {
    "points": ("point", "spot"),
    "panels": ("rectangle", "disc", "sphere", "tube"),
    "directionals": ("directional",),
}
_SHAPES = tuple(kind for kinds in MEMBER_KINDS.values() for kind in kinds)
_SHAPE_FIELDS = {
    "point": ("position",),
    "spot": ("position", "direction", "cone"),
    "rectangle": ("position", "direction", "rotation", "size"),
    "disc": ("position", "direction", "radius"),
    "sphere": ("position", "radius"),
    "tube": ("position", "direction", "radius", "length"),
    "directional": ("direction", "angle"),
}
_POINT_CONE = (180.0, 180.0)


class LightMembers(NamedTuple):
    """M lights of one source; fields as in a look, zeros if their kind lacks them.

    Attributes:
        position: meters. direction: of emission, any length. cone: half-angles, degrees; 180° of a point light.
        rotation: about the direction, degrees. size: of rectangles, meters.
        relative_emission: over the mean of the source; of area lights over the mean by area.
        radius, length: of discs, spheres and tubes, meters. angle: of directional lights, degrees.
        shape: index of the kind of the light.
    """

    position: Shaped[F32, "M 3"]
    direction: Shaped[F32, "M 3"]
    cone: Shaped[F32, "M 2"]
    rotation: Shaped[F32, " M"]
    size: Shaped[F32, "M 2"]
    relative_emission: Shaped[F32, " M"]
    radius: Shaped[F32, " M"]
    length: Shaped[F32, " M"]
    angle: Shaped[F32, " M"]
    shape: Shaped[F32, " M"]

    @classmethod
    def from_rows(cls, rows: Shaped[F32, "M 16"]) -> LightMembers:
        """Split rows of a file into fields. Raises SceneError if they are no members."""
        if rows.ndim != 2 or rows.shape[1] != NUM_COLUMNS or not len(rows) or not np.isfinite(rows).all():
            raise SceneError("the lights of a source are damaged; import the scene again")
        if not np.isin(rows[:, 15], np.arange(len(_SHAPES))).all():
            raise SceneError("the lights of a source have unknown shapes; import the scene again")
        return cls(rows[:, :3], rows[:, 3:6], rows[:, 6:8], rows[:, 8], rows[:, 9:11], *rows[:, 11:].T)

    def rows(self) -> Shaped[F32, "M 16"]:
        """All fields side by side, as in a file."""
        return np.column_stack(self).astype(np.float32)

    def light_fields(self, emission: Sequence[float]) -> list[dict[str, Any]]:
        """Return each light as in a look. emission: of the source, for each channel."""
        fields: list[dict[str, Any]] = []
        for k, relative in enumerate(self.relative_emission):
            kind = _SHAPES[int(self.shape[k])]
            shape = {field: getattr(self, field)[k].tolist() for field in _SHAPE_FIELDS[kind]}
            fields.append({"kind": kind, **shape, "emission": [float(relative) * channel for channel in emission]})
        return fields


def members_of(lights: Sequence[Mapping[str, Any]], relative_emission: Sequence[float]) -> LightMembers:
    """Return lights as members of one source.

    Args:
        lights: complete fields of lights of the kinds of one source. relative_emission: of each.
    """

    def column(field: str, default: Any) -> F32:
        return np.array([light.get(field, default) for light in lights], np.float32)

    return LightMembers(
        column("position", (0, 0, 0)),
        column("direction", (0, -1, 0)),
        column("cone", _POINT_CONE),
        column("rotation", 0),
        column("size", (0, 0)),
        np.array(relative_emission, np.float32),
        column("radius", 0),
        column("length", 0),
        column("angle", 0),
        np.array([_SHAPES.index(light["kind"]) for light in lights], np.float32),
    )
