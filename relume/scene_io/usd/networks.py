"""Shader networks of USD: nodes and inputs for `relume.scene_io.surfaces.node_values`, and surfaces of materials."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.surfaces.image_nodes import IMAGE_NODES, uv_texture
from relume.scene_io.surfaces.models import MODELS, SurfaceReader
from relume.scene_io.surfaces.node_values import AUTO, NODES, ImageNode, NodeValues, UnsupportedNodeError
from relume.scene_io.surfaces.preview_surface import PRESENCE
from relume.scene_io.surfaces.surface_images import SurfaceImages
from relume.scene_io.surfaces.surface_parameters import SurfaceParameters

GRAY = SurfaceParameters(base_color=(0.18, 0.18, 0.18), roughness=0.5)  # of shaders that are not supported
MATERIALX = "mtlx"  # context of outputs
_NODES: dict[str, ImageNode] = {**IMAGE_NODES, "UsdUVTexture": partial(uv_texture, wrap="useMetadata")}
_CATEGORIES = sorted({*MODELS, *NODES, *IMAGE_NODES}, key=len, reverse=True)
_TOKENS = {"presence": PRESENCE, "transparent": 0.0}  # of opacityMode


class UsdSurfaceReader:
    """Reads the surfaces of the materials of one stage.

    Args:
        time: a UsdTimeCode. images: of the stage. warnings: gets a sentence for each simplification.
    """

    def __init__(self, time: Any, images: SurfaceImages, warnings: list[ImporterWarning]) -> None:
        self._time, self._warnings = time, warnings
        self._reader = SurfaceReader(NodeValues(_NODES, warnings), images, warnings)

    def read(self, material: Any, label: str) -> SurfaceParameters:
        """Read a UsdShade.Material; gray with a warning if its shader is not supported.

        Args:
            material: the material. label: names it in warnings.
        """
        # the context of a network before the universal one, as in Hydra: exporters write placeholders into the latter
        shaders = [node for context in (MATERIALX, "") if (node := self._surface_node(material, context)) is not None]
        for node in shaders:
            if node.category in MODELS:
                if node is not shaders[0]:
                    other = f"its MaterialX shader {quote(shaders[0].category)} isn't supported"
                    self._warnings.append(unsupported(f"{_capital(label)} is shown by its plain surface: {other}."))
                return _with_cutoff(self._reader.read(node.category, node.ports(), label), shaders[-1])
        reason = f"its shader {quote(shaders[0].category)} isn't supported" if shaders else "it has no surface shader"
        self._warnings.append(unsupported(f"{_capital(label)} is shown gray: {reason}."))
        return GRAY

    def _surface_node(self, material: Any, context: str) -> UsdNode | None:
        source = material.ComputeSurfaceSource(context)
        shader = source[0] if isinstance(source, tuple) else source
        return UsdNode(shader, self._time) if shader and shader.GetPrim().IsValid() else None


def _with_cutoff(surface: SurfaceParameters, plain: UsdNode) -> SurfaceParameters:
    """A surface with the alpha test of the surface for other renderers: MaterialX has none."""
    port = plain.port("opacityThreshold")
    cutoff = 0.0 if port is None or port.node() is not None else next(iter(port.numbers()), 0.0)
    return replace(surface, alpha_mode="MASK", alpha_cutoff=cutoff) if 0 < cutoff <= 1 else surface


def _capital(label: str) -> str:
    return label[0].upper() + label[1:]


@dataclass(frozen=True)
class UsdNode:
    """A UsdShade.Shader at a time; identifiers of MaterialX are ND_category_type."""

    shader: Any
    time: Any

    @property
    def name(self) -> str:
        """Name of its prim."""
        return str(self.shader.GetPrim().GetName())

    @property
    def category(self) -> str:
        """See `ShaderNode.category`; the identifier of other shaders."""
        plain = self._identifier.removeprefix("ND_")
        known = (name for name in _CATEGORIES if plain == name or plain.startswith(f"{name}_"))
        return next(known, self._identifier)

    @property
    def type(self) -> str:
        """Type of its output in MaterialX."""
        return self._identifier.rsplit("_", 1)[-1]

    @property
    def _identifier(self) -> str:
        return str(self.shader.GetIdAttr().Get(self.time) or "")

    def port(self, name: str) -> UsdPort | None:
        """See `ShaderNode.port`."""
        usd_input = self.shader.GetInput(name)
        return UsdPort(usd_input, self.time) if usd_input else None

    def ports(self) -> list[tuple[str, UsdPort]]:
        """All inputs by name."""
        return [(usd_input.GetBaseName(), UsdPort(usd_input, self.time)) for usd_input in self.shader.GetInputs()]


@dataclass(frozen=True)
class UsdPort:
    """A UsdShade.Input at a time."""

    usd_input: Any
    time: Any

    @property
    def is_color(self) -> bool:
        """True for colors, and other values that the file gives a color space."""
        attribute = self._attribute()
        return attribute is not None and attribute.HasColorSpace()

    def node(self) -> tuple[UsdNode, str] | None:
        """See `Port.node`."""
        from pxr import UsdShade

        attribute = self._attribute()
        if attribute is None or UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Input:
            return None
        return UsdNode(UsdShade.Shader(attribute.GetPrim()), self.time), UsdShade.Output(attribute).GetBaseName()

    def numbers(self) -> tuple[float, ...]:
        """See `Port.numbers`."""
        value = self._value()
        if value is None or isinstance(value, str):
            return (_TOKENS[value],) if value in _TOKENS else ()
        try:
            numbers = np.asarray(value, np.float64).reshape(-1)
        except (TypeError, ValueError):
            raise UnsupportedNodeError(f"{quote(str(value))} is not a number") from None
        return tuple(float(f"{number:.7g}") for number in numbers.tolist()[:5])  # of single precision, as written

    def text(self) -> str:
        """See `Port.text`."""
        value = self._value()
        return str(value.path) if hasattr(value, "path") else value if isinstance(value, str) else ""

    def color_space(self) -> str:
        """See `Port.color_space`."""
        attribute = self._attribute()
        is_named = attribute is not None and attribute.HasColorSpace()
        return str(attribute.GetColorSpace()).lower() if is_named else AUTO

    def _value(self) -> Any:
        attribute = self._attribute()
        return None if attribute is None else attribute.Get(self.time)

    def _attribute(self) -> Any:
        """The input or output that has the value; None if there is none."""
        from pxr import UsdShade

        for attribute in UsdShade.Utils.GetValueProducingAttributes(self.usd_input):
            return attribute
        sources = self.usd_input.GetRawConnectedSourcePaths()
        stage = self.usd_input.GetPrim().GetStage()
        if any(not stage.GetPrimAtPath(path.GetPrimPath()) for path in sources):
            raise UnsupportedNodeError("it is connected to nothing that exists")
        return None if sources else self.usd_input.GetAttr()
