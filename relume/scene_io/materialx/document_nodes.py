"""Nodes and inputs of MaterialX documents, for `relume.scene_io.surfaces.node_values`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from relume.core.import_warnings import quote
from relume.scene_io.surfaces.node_values import TOO_COMPLEX, UnsupportedNodeError

Element = Any  # MaterialX has no types
MAX_NESTING = 32  # graphs within graphs


@dataclass(frozen=True)
class DocumentNode:
    """A node."""

    element: Element

    @property
    def name(self) -> str:
        """Its name."""
        return str(self.element.getName())

    @property
    def category(self) -> str:
        """Its category, such as "image"."""
        return str(self.element.getCategory())

    @property
    def type(self) -> str:
        """Type of its output."""
        return str(self.element.getType())

    def port(self, name: str) -> DocumentPort | None:
        """See `ShaderNode.port`."""
        port = self.element.getInput(name)
        return None if port is None else DocumentPort(port)


@dataclass(frozen=True)
class DocumentPort:
    """An input."""

    element: Element

    @property
    def is_color(self) -> bool:
        """True for colors, which have color spaces."""
        return str(self.element.getType()).startswith("color")

    def node(self) -> tuple[DocumentNode, str] | None:
        """See `Port.node`."""
        port = self._source()
        node = port.getConnectedNode()
        if node is not None:
            return DocumentNode(node), (port.getConnectedOutput() or port).getOutputString()
        if port.getNodeName() or port.getNodeGraphString() or port.getOutputString():
            raise UnsupportedNodeError("it has no node of that name")
        return None

    def numbers(self) -> tuple[float, ...]:
        """See `Port.numbers`."""
        text = self._source().getValueString()
        if text in ("true", "false"):
            return (float(text == "true"),)
        try:
            return tuple(float(word) for word in text.replace(",", " ").split())
        except ValueError:
            raise UnsupportedNodeError(f"{quote(text)} is not a number") from None

    def text(self) -> str:
        """See `Port.text`."""
        return str(self._source().getResolvedValueString())

    def color_space(self) -> str:
        """See `Port.color_space`."""
        return str(self._source().getActiveColorSpace()).lower()

    def _source(self) -> Element:
        """The input, or that of the graph that is its interface."""
        port = self.element
        for _ in range(MAX_NESTING):
            if not port.getInterfaceName():
                return port
            outer = port.getInterfaceInput()
            if outer is None:
                raise UnsupportedNodeError(f"its graph has no input {quote(port.getInterfaceName())}")
            port = outer
        raise UnsupportedNodeError(TOO_COMPLEX)
