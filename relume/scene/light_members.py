"""Lights of a file that are one source: their places, shapes and relative emission, one row each.

Kind "points" has point and spot lights, kind "panels" rectangles. The look sets what all of them emit, their mean; a
row has the emission of one relative to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError

F32 = NDArray[np.float32]

NUM_COLUMNS = 12
MAX_MEMBERS = 100_000  # of a scene
MEMBER_KINDS = {"points": ("point", "spot"), "panels": ("rectangle",)}
_POINT_CONE = (180.0, 180.0)


class LightMembers(NamedTuple):
    """M lights of one source; fields as in a look, zeros if their kind lacks them.

    Attributes:
        position: meters. direction: of emission, any length. cone: half-angles, degrees; 180° of a point light.
        rotation: about the direction, degrees. size: of rectangles, meters.
        relative_emission: over the mean of the source; of rectangles over the mean by area.
    """

    position: Shaped[F32, "M 3"]
    direction: Shaped[F32, "M 3"]
    cone: Shaped[F32, "M 2"]
    rotation: Shaped[F32, " M"]
    size: Shaped[F32, "M 2"]
    relative_emission: Shaped[F32, " M"]

    @classmethod
    def from_rows(cls, rows: Shaped[F32, "M 12"]) -> LightMembers:
        """Split rows of a file into fields. Raises SceneError if they are no members."""
        if rows.ndim != 2 or rows.shape[1] != NUM_COLUMNS or not len(rows) or not np.isfinite(rows).all():
            raise SceneError("the lights of a source are damaged; import the scene again")
        return cls(rows[:, :3], rows[:, 3:6], rows[:, 6:8], rows[:, 8], rows[:, 9:11], rows[:, 11])

    def rows(self) -> Shaped[F32, "M 12"]:
        """All fields side by side, as in a file."""
        columns = [self.position, self.direction, self.cone, self.rotation, self.size, self.relative_emission]
        return np.column_stack(columns).astype(np.float32)

    def light_fields(self, kind: str, emission: Sequence[float]) -> list[dict[str, Any]]:
        """Return each light as in a look. kind: "points" or "panels"; emission: of the source, for each channel."""
        return [
            {**self._shape(kind, k), "emission": [float(relative) * channel for channel in emission]}
            for k, relative in enumerate(self.relative_emission)
        ]

    def _shape(self, kind: str, k: int) -> dict[str, Any]:
        position, direction = self.position[k].tolist(), self.direction[k].tolist()
        if kind == "panels":
            shape = {"rotation": float(self.rotation[k]), "size": self.size[k].tolist()}
            return {"kind": "rectangle", "position": position, "direction": direction, **shape}
        if self.cone[k, 1] > 90:
            return {"kind": "point", "position": position}
        return {"kind": "spot", "position": position, "direction": direction, "cone": self.cone[k].tolist()}


def members_of(lights: Sequence[Mapping[str, Any]], relative_emission: Sequence[float]) -> LightMembers:
    """Return lights as members of one source.

    Args:
        lights: complete fields of point and spot lights, or of rectangles. relative_emission: of each.
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
    )
