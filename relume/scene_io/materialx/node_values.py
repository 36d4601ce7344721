"""Values of inputs in node graphs: constants, and images that nodes scale or take channels of.

Everything else raises `UnsupportedNodeError`, and the input of the surface has its default.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from relume.core.color import srgb_decode
from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.materialx.texture_coordinates import Pair
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Rgb, Value, scaled

Element = Any  # MaterialX has no types
MAX_STEPS = 20_000  # nodes that the inputs of one document visit
TOO_COMPLEX = "its node graph is too complex"
SRGB = ("srgb_texture", "srgb_rec709_scene", "srgb_rec709_display", "sRGB")
LINEAR = ("", "lin_rec709", "lin_rec709_scene", "linear", "none", "raw", "data")
_CHANNELS = {"x": "r", "y": "g", "z": "b", "w": "a", "r": "r", "g": "g", "b": "b", "a": "a"}


class UnsupportedNodeError(Exception):
    """A value that is neither a constant nor one image; the message says why, as a clause."""


class NodeValues:
    """Evaluates inputs of one document, with a limit on the nodes that are visited.

    Args:
        image_nodes: by category, functions from a node and the name of its output to its image.
        warnings: gets a sentence for each color space and placement that is read as another.
    """

    def __init__(
        self,
        image_nodes: Mapping[str, Callable[[NodeValues, Element, str], ImageInput]],
        warnings: list[ImporterWarning],
    ) -> None:
        self._image_nodes, self._warnings = image_nodes, warnings
        self._remaining_steps = MAX_STEPS

    def value(self, port: Element) -> Value | None:
        """The value of an input; None if it has none. Raises UnsupportedNodeError."""
        port = self.source(port)
        node = port.getConnectedNode()
        if node is not None:
            return self._node(node, (port.getConnectedOutput() or port).getOutputString())
        if port.getNodeName() or port.getNodeGraphString() or port.getOutputString():
            raise UnsupportedNodeError("it has no node of that name")
        return self._constant(port)

    def source(self, port: Element) -> Element:
        """Follow the interfaces of graphs from an input. Raises UnsupportedNodeError."""
        self._remaining_steps -= 1
        if self._remaining_steps < 0:
            raise UnsupportedNodeError(TOO_COMPLEX)
        if not port.getInterfaceName():
            return port
        outer = port.getInterfaceInput()
        if outer is None:
            raise UnsupportedNodeError(f"its graph has no input {quote(port.getInterfaceName())}")
        return self.source(outer)

    def required(self, node: Element, name: str) -> Value:
        """The value of a node's input that has no default. Raises UnsupportedNodeError."""
        value = self._optional(node, name)
        if value is None:
            raise UnsupportedNodeError(f"node {quote(node.getName())} has no input {quote(name)}")
        return value

    def numbers(self, node: Element, name: str, default: Rgb) -> Rgb:
        """A constant of a node, as three numbers; see `required`.

        Args:
            node: the node. name: of its input. default: of the node.
        """
        value = self._optional(node, name)
        if isinstance(value, ImageInput):
            raise UnsupportedNodeError(f"{name} of node {quote(node.getName())} isn't constant")
        return default if value is None else value if isinstance(value, tuple) else (value, value, value)

    def pair(self, node: Element, name: str, default: Pair) -> Pair:
        """As `numbers`, of two numbers; node, name, default."""
        first, second, _ = self.numbers(node, name, (*default, 0.0))
        return first, second

    def warn(self, sentence: str) -> None:
        """Add a warning once."""
        if sentence not in self._warnings:
            self._warnings.append(unsupported(sentence))

    def is_srgb(self, port: Element) -> bool:
        """True if colors of an input are in sRGB; other color spaces than linear Rec. 709 are a warning."""
        space = port.getActiveColorSpace()
        if space not in (*SRGB, *LINEAR):
            self.warn(f"The color space {quote(space)} isn't supported; it is read as linear Rec. 709.")
        return space in SRGB

    def _optional(self, node: Element, name: str) -> Value | None:
        port = node.getInput(name)
        return None if port is None else self.value(port)

    def _constant(self, port: Element) -> Value | None:
        text = port.getValueString()
        if not text:
            return None
        try:
            numbers = [float(word) for word in text.replace(",", " ").split()]
        except ValueError:
            if text in ("true", "false"):
                return float(text == "true")
            raise UnsupportedNodeError(f"{quote(text)} is not a number") from None
        if len(numbers) == 1:
            return numbers[0]
        if not 2 <= len(numbers) <= 4:
            raise UnsupportedNodeError(f"it has {len(numbers)} numbers")
        red, green, blue = (*numbers, 0.0)[:3]
        if port.getType().startswith("color") and self.is_srgb(port):
            red, green, blue = srgb_decode(np.array([red, green, blue], np.float64)).tolist()
        return red, green, blue

    def _node(self, node: Element, output: str) -> Value:
        category = node.getCategory()
        if category in self._image_nodes:
            return self._image_nodes[category](self, node, output)
        if category == "constant":
            return self.required(node, "value")
        if category in ("dot", "convert"):
            return self.required(node, "in")
        if category == "extract":
            index = round(self.numbers(node, "index", (0.0, 0.0, 0.0))[0])
            return _channel(self.required(node, "in"), "rgba"[min(max(index, 0), 3)])
        if category in ("separate2", "separate3", "separate4") and output[-1:] in _CHANNELS:
            return _channel(self.required(node, "in"), _CHANNELS[output[-1]])
        if category == "multiply":
            return _product(self.required(node, "in1"), self.required(node, "in2"))
        if category == "normalmap":
            return _product(self.required(node, "in"), self.numbers(node, "scale", (1.0, 1.0, 1.0)))
        raise UnsupportedNodeError(f"node {quote(node.getName())} ({category[:40]}) isn't supported")


def _channel(value: Value, channel: str) -> Value:
    if isinstance(value, ImageInput):
        index = min("rgba".index(channel), 2)
        factor = value.factor[index] if channel != "a" else 1.0
        return replace(value, channel=channel, factor=(factor, factor, factor), default=None)
    if isinstance(value, tuple):
        return value["rgb".index(channel)] if channel != "a" else 1.0
    return value


def _product(a: Value, b: Value) -> Value:
    if isinstance(a, ImageInput) and isinstance(b, ImageInput):
        raise UnsupportedNodeError("a product of two images isn't supported")
    if isinstance(b, ImageInput):
        a, b = b, a
    factor = b if isinstance(b, tuple) else (float(b), float(b), float(b))  # type: ignore[arg-type]
    if isinstance(a, float):
        return a * b if isinstance(b, float) else scaled((a, a, a), factor)
    return scaled(a, factor)
