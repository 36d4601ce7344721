"""KHR_lights_punctual as the scene's local lights.

The extension uses photometric units, candela and lux, and relume radiometric ones. Exporters that work in watts
multiply by 683 lm/W, the luminous efficacy of green light at 555 nm; this divides by it. Others write watts as they
are, which the file does not say: see `relume.scene_io.import_options.ImportOptions`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from relume.core.color import LUMENS_PER_WATT
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.scene.collect_lights import LightCollector
from relume.scene.validate import MAX_METERS
from relume.scene_io.gltf.document import Document, Factor, Index, Name, Node, Number
from relume.scene_io.gltf.tolerant import GltfObjects, read_object
from relume.scene_io.import_options import LightUnit

F64 = NDArray[np.float64]

EXTENSION = "KHR_lights_punctual"
_DIM = 20.0  # candela: 0.4 W in a file in candela, 250 W in one in W/sr
_MAX_DEFINITIONS = 10_000
_UNITS = approximated(f"Light strengths converted from candela/lux to watts ({LUMENS_PER_WATT:g} lm/W).")


class _Spot(BaseModel, frozen=True):
    """The half-angles of a spot's cone, radians."""

    innerConeAngle: Annotated[float, Field(ge=0, le=np.pi / 2, allow_inf_nan=False)] = 0.0  # noqa: N815
    outerConeAngle: Annotated[float, Field(gt=0, le=np.pi / 2, allow_inf_nan=False)] = np.pi / 4  # noqa: N815


class _Punctual(BaseModel, frozen=True):
    """One light, shared by the nodes that refer to it."""

    name: Name = ""
    type: Literal["point", "spot", "directional"]
    color: Annotated[list[Factor], Field(min_length=3, max_length=3)] = [1.0, 1.0, 1.0]
    intensity: Annotated[Number, Field(ge=0)] = 1.0
    range: Number | None = None
    spot: _Spot = _Spot()


class _PunctualLights(BaseModel, frozen=True):
    """The extension at the document; its lights are unchecked."""

    lights: list[Any] = []


class _LightReference(BaseModel, frozen=True):
    """The extension at a node."""

    light: Index


class LightReader:
    """Reads the lights of one file's nodes."""

    def __init__(
        self, document: Document, collector: LightCollector, unit: LightUnit, warnings: list[ImporterWarning]
    ) -> None:
        self._collector, self._unit, self._warnings = collector, unit, warnings
        self._intensities: list[float] = []  # of point and spot lights, as in the file
        definitions: list[Any] = []
        try:
            content = document.root.extensions.get(EXTENSION, {})
            definitions = read_object(_PunctualLights, content, f"{EXTENSION} of the file", warnings).lights
        except SceneError as problem:
            warnings.append(unsupported(f"Lights were left out: {problem}."))
        if len(definitions) > _MAX_DEFINITIONS:
            raise SceneError(f"the scene has more than {_MAX_DEFINITIONS:,} lights, the limit; remove some")
        self._definitions = GltfObjects(_Punctual, definitions, "light", warnings)

    def add(self, node: Node, label: str, to_world: Shaped[F64, "4 4"]) -> None:
        """Add the light of a node, if there is one; it emits along the node's −Z.

        Args:
            node: from the document. label: names it in warnings. to_world: its transform.
        """
        if EXTENSION not in node.extensions:
            return
        try:
            reference = read_object(
                _LightReference, node.extensions[EXTENSION], f"the light of {label}", self._warnings
            )
            light = self._definitions.get(reference.light, label)
        except SceneError as problem:
            self._warnings.append(unsupported(f"A light was left out: {problem}."))
            return
        name = self._collector.name(light.name or node.name or light.type)
        direction, position = -to_world[:3, 2], to_world[:3, 3]
        length = float(np.linalg.norm(direction))
        if np.abs(position).max() > MAX_METERS or (light.type != "point" and length < 1e-12):
            message = f"Skipped light {quote(name)}: its scale is zero or its position is out of range."
            self._warnings.append(unsupported(message))
            return
        fields: dict[str, Any] = {"kind": light.type}
        if light.type != "directional":
            fields["position"] = position.tolist()
        if light.type != "point":
            fields["direction"] = (direction / length).tolist()
        if light.type == "spot":
            outer = min(np.degrees(light.spot.outerConeAngle), 90.0)
            fields["cone"] = [min(float(np.degrees(light.spot.innerConeAngle)), outer), outer]
        if light.range is not None:
            self._warnings.append(approximated(f"The range of light {quote(name)} is ignored; it reaches everywhere."))
        if self._unit == "file" and _UNITS not in self._warnings:
            self._warnings.append(_UNITS)
        if light.type != "directional":
            self._intensities.append(light.intensity)
        emission = np.array(light.color) * light.intensity / self._divisor(light.type)
        self._collector.add(name, fields, emission, instance=reference.light)

    def _divisor(self, kind: str) -> float:
        """Strength in the file over W/sr, or W/m² of a directional light; a spot's power is that of a point light."""
        power = 1.0 if kind == "directional" else 4 * np.pi
        return {"file": LUMENS_PER_WATT, "W/sr": 1.0, "W": power}[self._unit]

    def warn_dim_lights(self, generator: str) -> None:
        """Warn if all lights are so dim that their unit is hardly candela."""
        brightest = max(self._intensities, default=0.0)
        if self._unit == "file" and 0 < brightest < _DIM:
            author = f", by {quote(generator)}," if generator else ""
            message = (
                f"The brightest light of the file{author} has {brightest:.3g} candela: if all are too dark, import"
            )
            self._warnings.append(unsupported(f"{message} with the light unit W/sr, or W."))
