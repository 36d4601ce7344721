"""Import options: properties of a scene that its file does not say, or says wrong."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

UpAxis = Literal["file", "y", "z", "-z"]
Unit = Literal["file", "m", "cm", "mm", "in", "ft", "auto"]
Recenter = Literal["auto", "always", "never"]
LightUnit = Literal["file", "W/sr", "W"]


class ImportOptions(BaseModel):
    """Properties of a scene that its file does not say.

    Attributes:
        up: the file's axis that points up. "file": as the file says, +Y if it does not.
        unit: the file's unit. "file": as the file says, meters if it does not. "auto": a guess from the size.
        recenter: whether positions are relative to the middle of the scene. "auto": if it is more than a hundred times
            its size from the origin, where single precision would round the shape.
        light_unit: unit of the file's punctual lights. "file": as the format says, candela and lux in glTF. "W/sr":
            radiometric, W/sr and W/m², as Blender exports "Unitless". "W": power of point and spot lights, as "Raw".
        scene_name: name or number of the scene to read, of a glTF file with several; empty for the file's default.
        time: moment of the animation, seconds in glTF, time code in USD. None: the rest pose of glTF, the first time
            of USD.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    up: UpAxis = "file"
    unit: Unit = "file"
    recenter: Recenter = "auto"
    light_unit: LightUnit = "file"
    scene_name: Annotated[str, Field(max_length=200)] = ""
    time: Annotated[float, Field(allow_inf_nan=False)] | None = None

    def document(self) -> dict[str, str]:
        """The options as text, without those that have their default."""
        return {key: str(value) for key, value in self.model_dump(exclude_defaults=True).items()}
