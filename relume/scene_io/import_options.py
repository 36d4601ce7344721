"""Import options: properties of a scene that its file does not say, or says wrong."""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from relume.core.import_warnings import ImporterWarning, ignored

F64 = NDArray[np.float64]
UpAxis = Literal["file", "y", "z", "-z"]
Unit = Literal["file", "m", "cm", "mm", "in", "ft", "auto"]
Recenter = Literal["auto", "always", "never"]
METERS = {"file": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
FAR = 100.0  # of its size from the origin: float32 rounds positions to 6 millionths of the size


class ImportOptions(BaseModel):
    """Properties of a scene that its file does not say.

    Attributes:
        up: the file's axis that points up. "file": as the file says, +Y if it does not.
        unit: the file's unit. "file": as the file says, meters if it does not. "auto": a guess from the size.
        recenter: whether positions are relative to the middle of the scene. "auto": if it is more than a hundred times
            its size from the origin, where single precision would round the shape.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    up: UpAxis = "file"
    unit: Unit = "file"
    recenter: Recenter = "auto"

    def document(self) -> dict[str, str]:
        """The options as JSON, without those that have their default."""
        return self.model_dump(exclude_defaults=True)


def choose_origin(low: Shaped[F64, " 3"], high: Shaped[F64, " 3"], recenter: Recenter) -> Shaped[F64, " 3"]:
    """Return the new origin of positions, in the coordinates of the file: the middle of the scene, or zero.

    Args:
        low, high: bounding box of the scene. recenter: see `ImportOptions`.
    """
    is_far = float(np.maximum(np.abs(low), np.abs(high)).max()) > FAR * float(np.linalg.norm(high - low))
    return (low + high) / 2 if recenter == "always" or (recenter == "auto" and is_far) else np.zeros(3)


def moved_warning(origin: Shaped[F64, " 3"]) -> list[ImporterWarning]:
    """A warning about a new origin, in the coordinates of the file; none if it is zero."""
    if not origin.any():
        return []
    x, y, z = (f"{value:,.10g}" for value in origin)
    message = f"Positions are relative to ({x}; {y}; {z}) of the file: the middle of the scene, which is far from zero."
    return [ignored(message)]
