"""Values of inputs in node graphs of MaterialX and USD: constants, and images that nodes scale or take channels of.

Everything else raises `UnsupportedNodeError`, and the input of the surface has its default.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.core.color import srgb_decode
from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Rgb, Value, channel, encoded_normals, scaled
from relume.scene_io.surfaces.texture_coordinates import Pair

MAX_STEPS = 20_000  # nodes that the inputs of one document visit, and of each of its surfaces
STEPS_PER_SURFACE = 200
TOO_COMPLEX = "its node graph is too complex"
AUTO = "auto"
SRGB = ("srgb", "srgb_texture", "srgb_rec709_scene", "srgb_rec709_display", "g22_rec709")
LINEAR = (
    "", "lin_rec709", "lin_rec709_scene", "lin_srgb", "linear", "none", "raw", "data", "scene-linear rec.709-srgb"
)  # fmt: skip
FRAME_VECTORS = ("normal", "tangent")  # nodes: of the surface
_CHANNELS = {"x": "r", "y": "g", "z": "b", "w": "a", "r": "r", "g": "g", "b": "b", "a": "a"}
_ONE: Rgb = (1.0, 1.0, 1.0)


class UnsupportedNodeError(Exception):
    """A value that is neither a constant nor one image; the message says why, as a clause."""


class Port(Protocol):
    """An input of a node or a shader; interfaces of graphs are followed. Methods raise UnsupportedNodeError."""

    @property
    def is_color(self) -> bool: ...

    def node(self) -> tuple[ShaderNode, str] | None:
        """The node that it is connected to, and the name of its output."""
        ...

    def numbers(self) -> tuple[float, ...]:
        """Its constant; empty without one."""
        ...

    def text(self) -> str:
        """Its constant if that is a name or a file; empty without one."""
        ...

    def color_space(self) -> str:
        """Lower-case name; empty for linear Rec. 709, `AUTO` if the image decides."""
        ...


class ShaderNode(Protocol):
    """A node of a graph. `category` is as in MaterialX or USD, `type` as in MaterialX, empty if unknown."""

    @property
    def name(self) -> str: ...

    @property
    def category(self) -> str: ...

    @property
    def type(self) -> str: ...

    def port(self, name: str) -> Port | None:
        """An input; None if it does not exist."""
        ...


@dataclass(frozen=True)
class PrimvarReference:
    """Values of a primvar of the mesh; `default` without it."""

    name: str
    default: Rgb | None = None


NodeValue = Value | PrimvarReference
ImageNode = Callable[["NodeValues", ShaderNode, str], NodeValue]


class NodeValues:
    """Evaluates inputs of one document, with a limit on the nodes that are visited.

    Args:
        image_nodes: by category, functions from a node and the name of its output to its value.
        warnings: gets a sentence for each color space and placement that is read as another.
    """

    def __init__(self, image_nodes: Mapping[str, ImageNode], warnings: list[ImporterWarning]) -> None:
        self._image_nodes, self._warnings = image_nodes, warnings
        self._remaining_steps = MAX_STEPS

    def surface(self, ports: Iterable[tuple[str, Port]], label: str) -> dict[str, NodeValue]:
        """The values of a shader's inputs; those that cannot be read are left out, with a warning.

        Args:
            ports: names and inputs. label: names the material in warnings.
        """
        self._remaining_steps += STEPS_PER_SURFACE
        results = dict[str, NodeValue]()
        for name, port in ports:
            try:
                value = self.value(port)
            except (UnsupportedNodeError, RecursionError) as error:
                reason = TOO_COMPLEX if isinstance(error, RecursionError) else error
                self._warnings.append(unsupported(f"{name} of {label} has its default: {reason}."))
                continue
            if value is not None:
                results[name] = value
        return results

    def value(self, port: Port) -> NodeValue | None:
        """The value of an input; None if it has none. Raises UnsupportedNodeError."""
        self._remaining_steps -= 1
        if self._remaining_steps < 0:
            raise UnsupportedNodeError(TOO_COMPLEX)
        source = port.node()
        return self._constant(port) if source is None else self._node(*source)

    def required(self, node: ShaderNode, name: str) -> Value:
        """The value of a node's input that has no default. Raises UnsupportedNodeError.

        Args:
            node: the node. name: of its input.
        """
        value = self._optional(node, name)
        if value is None or isinstance(value, PrimvarReference):
            reason = "has no input" if value is None else "isn't supported with a primvar as"
            raise UnsupportedNodeError(f"node {quote(node.name)} {reason} {quote(name)}")
        return value

    def numbers(self, node: ShaderNode, name: str, default: Rgb) -> Rgb:
        """A constant of a node, as three numbers; see `required`.

        Args:
            node: the node. name: of its input. default: of the node.
        """
        value = self._optional(node, name)
        if isinstance(value, ImageInput | PrimvarReference):
            raise UnsupportedNodeError(f"{name} of node {quote(node.name)} isn't constant")
        return default if value is None else value if isinstance(value, tuple) else (value, value, value)

    def pair(self, node: ShaderNode, name: str, default: Pair) -> Pair:
        """As `numbers`, of two numbers; node, name, default."""
        first, second, _ = self.numbers(node, name, (*default, 0.0))
        return first, second

    def text(self, node: ShaderNode, name: str, default: str = "") -> str:
        """A name or file of a node; node, name, default."""
        port = node.port(name)
        return (port.text() if port is not None else "") or default

    def warn(self, sentence: str) -> None:
        """Add a warning about something that looks different from the document, once."""
        if sentence not in self._warnings:
            self._warnings.append(unsupported(sentence))

    def is_srgb(self, space: str) -> bool | None:
        """True if a color space is sRGB; None if the image decides. Others than linear Rec. 709 are a warning."""
        if space not in (*SRGB, *LINEAR, AUTO):
            self.warn(f"The color space {quote(space)} isn't supported; it is read as linear Rec. 709.")
        return None if space == AUTO else space in SRGB

    def _optional(self, node: ShaderNode, name: str) -> NodeValue | None:
        port = node.port(name)
        return None if port is None else self.value(port)

    def _constant(self, port: Port) -> Value | None:
        numbers = port.numbers()
        if len(numbers) <= 1:
            return numbers[0] if numbers else None
        if len(numbers) > 4:
            raise UnsupportedNodeError(f"it has {len(numbers)} numbers")
        red, green, blue = (*numbers, 0.0)[:3]
        if port.is_color and self.is_srgb(port.color_space()):
            red, green, blue = srgb_decode(np.array([red, green, blue], np.float64)).tolist()
        return red, green, blue

    def _primvar(self, node: ShaderNode) -> PrimvarReference:
        fallback = "fallback" if node.category == "UsdPrimvarReader" else "default"
        default = None if node.port(fallback) is None else self.numbers(node, fallback, (0.0, 0.0, 0.0))
        return PrimvarReference(self.text(node, "varname") or self.text(node, "geomprop"), default)

    def _node(self, node: ShaderNode, output: str) -> NodeValue | None:
        category = node.category
        if category in self._image_nodes:
            return self._image_nodes[category](self, node, output)
        if category in FRAME_VECTORS:
            return PrimvarReference(category)
        if category in ("constant", "dot", "convert", "normalize"):
            return self._optional(node, "value" if category == "constant" else "in")
        if category == "extract":
            index = round(self.numbers(node, "index", (0.0, 0.0, 0.0))[0])
            return channel(self.required(node, "in"), "rgba"[min(max(index, 0), 3)])
        if category in ("separate2", "separate3", "separate4") and output[-1:] in _CHANNELS:
            return channel(self.required(node, "in"), _CHANNELS[output[-1]])
        if category == "multiply":
            return _product(self.required(node, "in1"), self.required(node, "in2"))
        if category == "normalmap":
            return normal_vector(self.required(node, "in"), self.numbers(node, "scale", _ONE))
        if category in ("geompropvalue", "UsdPrimvarReader"):
            return self._primvar(node)
        raise UnsupportedNodeError(f"node {quote(node.name)} ({category[:40]}) isn't supported")


NODES = (
    *("constant", "dot", "convert", "extract", "separate2", "separate3", "separate4", "multiply", "normalmap"),
    *("add", "rotate2d", "rotate3d", "normalize", *FRAME_VECTORS),
    *("geompropvalue", "UsdPrimvarReader", "texcoord", "place2d", "UsdTransform2d"),
)
"""Categories that are supported, beside those of images."""


def normal_vector(value: Value, scale: Rgb) -> Value:
    """A normal as a vector, see `encoded_normals`; constants are vectors already."""
    return encoded_normals(value, scale) if isinstance(value, ImageInput) else value


def _product(a: Value, b: Value) -> Value:
    if isinstance(a, ImageInput) and isinstance(b, ImageInput):
        raise UnsupportedNodeError("a product of two images isn't supported")
    if isinstance(b, ImageInput):
        a, b = b, a
    factor = b if isinstance(b, tuple) else (float(b), float(b), float(b))  # type: ignore[arg-type]
    if isinstance(a, float):
        return a * b if isinstance(b, float) else scaled((a, a, a), factor)
    return scaled(a, factor)
