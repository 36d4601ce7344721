"""Bodies of exports."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from relume.export.export_document import MAX_VARIANTS
from relume_server.schemas.base import Body, Name

ExportFormatName = Literal["glb", "materialx", "usd", "light_mix"]


class ExportRequest(Body):
    """A scene with a look as a file.

    `look`: a look document, may be partial. `saved_look`: the name of a saved look, instead. `variants`: names of
    further saved looks, whose materials the file offers as variants. `format` "light_mix": JSON with brightness and
    color of lights by name, itself accepted as a look.
    """

    format: ExportFormatName = "glb"
    look: Annotated[dict[str, Any], Field(default_factory=dict)]
    saved_look: Name | None = None
    variants: Annotated[list[Name], Field(default_factory=list, max_length=MAX_VARIANTS)]


class ExportedMaterial(Body):
    """A material of an export.

    `look`: the variant; null for the exported look. `exact`: the file has the same reflectance. `error`: relative RMS
    error of cosine-weighted BRDF values. `omitted`: a sentence for each feature that the file does not have.
    """

    name: str
    look: str | None
    exact: bool
    error: float
    omitted: list[str]


class ExportReportBody(Body):
    """Differences between a look and its file: by material, and of the scene, a sentence each."""

    materials: list[ExportedMaterial]
    omitted: list[str]
