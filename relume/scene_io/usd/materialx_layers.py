"""MaterialX documents as layers, as USD's own plug-in for `.mtlx` files makes them; usd-core comes without it.

Each material becomes `/MaterialX/Materials/<name>` with its shader and the nodes before it. Names of shaders are those
of MaterialX's definitions, ND_<node>_<type>.
"""

from __future__ import annotations

import posixpath
from typing import Any
from xml.etree import ElementTree

from relume.core.errors import MaterialError, SceneError
from relume.scene_io.materialx.safe_xml import check_xml

ROOT = "/MaterialX/Materials"
MAX_NODES = 10_000  # of all materials
MAX_DEPTH = 32  # nodes between a shader and an image
INPUT_TAGS = ("input", "parameter")
COLORS = ("color3", "color4")


def write_materialx_layer(data: bytes, path: str) -> Any:
    """Convert a document to a layer.

    Args:
        data: the .mtlx file. path: of the new layer.
    Returns:
        An Sdf.Layer.
    Raises:
        SceneError: it is not XML, declares entities, or has too many nodes.
    """
    from pxr import Sdf, Usd

    if b"<!" in data.replace(b"<!--", b""):
        raise SceneError("it declares entities; remove them")
    try:
        check_xml(data)  # in any text encoding
    except MaterialError as error:
        raise SceneError(str(error)) from None
    document = ElementTree.fromstring(data)  # noqa: S314  (there are no entities to expand)
    layer = Sdf.Layer.CreateNew(path)
    stage = Usd.Stage.Open(layer)
    stage.DefinePrim("/MaterialX")
    stage.DefinePrim(ROOT)
    _Writer(stage, document).write_materials()
    return layer


class _Writer:
    """Writes the materials of one document into a stage."""

    def __init__(self, stage: Any, document: ElementTree.Element) -> None:
        self._stage, self._document = stage, document
        self._num_nodes = 0
        self._color_space = document.get("colorspace", "")

    def write_materials(self) -> None:
        """Write each material with a surface shader."""
        from pxr import Tf, UsdShade

        for element in self._document.iter("surfacematerial"):
            name = Tf.MakeValidIdentifier(element.get("name", "material"))
            material = UsdShade.Material.Define(self._stage, f"{ROOT}/{name}")
            for socket in element.findall("input"):
                shader = _find(self._document, socket.get("nodename", ""))
                if socket.get("name") == "surfaceshader" and shader is not None:
                    output = self._write_node(shader, self._document, str(material.GetPath()), "out", 0)
                    material.CreateSurfaceOutput("mtlx").ConnectToSource(output)

    def _write_node(
        self, node: ElementTree.Element, graph: ElementTree.Element, parent: str, output: str, depth: int
    ) -> Any:
        """Write a node and all before it; return its output.

        Args:
            graph: document or node graph that contains the node. parent: path of the prim to put it into.
        """
        from pxr import Sdf, Tf, UsdShade

        self._num_nodes += 1
        if self._num_nodes > MAX_NODES or depth > MAX_DEPTH:
            raise SceneError(f"it has more than {MAX_NODES:,} nodes, or loops; simplify it")
        name = Tf.MakeValidIdentifier(f"{graph.get('name', '')}_{node.get('name', '')}")
        shader = UsdShade.Shader.Define(self._stage, f"{parent}/{name}")
        if not shader.GetIdAttr().HasAuthoredValue():
            shader.CreateIdAttr(f"ND_{node.tag}_{node.get('type', '')}")
            for element in node:
                if element.tag in INPUT_TAGS:
                    self._write_input(shader, element, graph, parent, depth)
        return shader.CreateOutput(Tf.MakeValidIdentifier(output), Sdf.ValueTypeNames.Token)

    def _write_input(
        self, shader: Any, element: ElementTree.Element, graph: ElementTree.Element, parent: str, depth: int
    ) -> None:
        """Write an input with its value, or connect it to its node."""
        from pxr import Tf

        value_type = _TYPES.get(element.get("type", ""))
        if value_type is None:
            return
        name = Tf.MakeValidIdentifier(element.get("name", ""))
        usd_input = shader.CreateInput(name, _usd_type(value_type[0]))
        interface = _find(graph, element.get("interfacename", ""))
        element = element if interface is None else interface
        inner = _find(self._document, element.get("nodegraph", "")) if element.get("nodegraph") else graph
        source = element.get("nodename", "")
        output = element.get("output", "out")
        if element.get("nodegraph") and inner is not None:
            socket = next((out for out in inner.findall("output") if out.get("name") == element.get("output")), None)
            socket = inner.find("output") if socket is None else socket
            source, output = (
                ("", "out") if socket is None else (socket.get("nodename", ""), socket.get("output", "out"))
            )
        node = _find(graph if inner is None else inner, source)
        if node is not None and inner is not None:
            usd_input.ConnectToSource(self._write_node(node, inner, parent, output, depth + 1))
        elif element.get("value") is not None:
            self._write_value(usd_input, element, graph, value_type[1], shader)

    def _write_value(
        self, usd_input: Any, element: ElementTree.Element, graph: ElementTree.Element, count: int, shader: Any
    ) -> None:
        text = element.get("value", "")
        if count == 0:
            if element.get("type") == "filename":
                prefix = element.get("fileprefix", graph.get("fileprefix", self._document.get("fileprefix", "")))
                text = text if posixpath.isabs(text) else prefix + text
            usd_input.Set(text)
        else:
            numbers = _numbers(text, element.get("type", ""))
            if len(numbers) != count:
                return
            usd_input.Set(numbers[0] if count == 1 else tuple(numbers))
        is_color = element.get("type") in COLORS or str(shader.GetIdAttr().Get()).endswith(COLORS)
        color_space = element.get("colorspace", graph.get("colorspace", self._color_space) if is_color else "")
        if color_space:
            usd_input.GetAttr().SetColorSpace(color_space)


_TYPES = {
    "float": ("Float", 1), "integer": ("Float", 1), "boolean": ("Float", 1), "color3": ("Color3f", 3),
    "color4": ("Color4f", 4), "vector2": ("Float2", 2), "vector3": ("Float3", 3), "vector4": ("Float4", 4),
    "string": ("String", 0), "filename": ("Asset", 0),
}  # fmt: skip
"""Type in USD and number of numbers, by the type in MaterialX."""


def _usd_type(name: str) -> Any:
    from pxr import Sdf

    return getattr(Sdf.ValueTypeNames, name)


def _find(graph: ElementTree.Element, name: str) -> ElementTree.Element | None:
    """A node, node graph or input by its name; None if there is none."""
    return next((element for element in graph if name and element.get("name") == name), None)


def _numbers(text: str, kind: str) -> list[float]:
    if kind == "boolean":
        return [float(text.strip().lower() == "true")]
    try:
        return [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return []
