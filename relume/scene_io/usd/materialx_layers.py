"""MaterialX documents as layers, as USD's own plug-in for `.mtlx` files makes them; usd-core comes without it.

Each material becomes `/MaterialX/Materials/<name>` with its shader and the nodes before it. Names of shaders are those
of MaterialX's definitions, ND_<node>_<type>.
"""

from __future__ import annotations

from typing import Any

from relume.core.errors import MaterialError, SceneError
from relume.scene_io.materialx.document_nodes import DocumentNode, DocumentPort
from relume.scene_io.materialx.import_document import connected_node, parse_materialx
from relume.scene_io.surfaces.node_values import UnsupportedNodeError

ROOT = "/MaterialX/Materials"
MAX_NODES = 10_000  # of all materials
MAX_DEPTH = 32  # nodes between a shader and an image
_USD_TYPES = {
    "float": "Float", "integer": "Float", "boolean": "Float", "color3": "Color3f", "color4": "Color4f",
    "vector2": "Float2", "vector3": "Float3", "vector4": "Float4", "string": "String", "filename": "Asset",
}  # fmt: skip
"""Types in USD by those in MaterialX."""


def write_materialx_layer(data: bytes, path: str) -> Any:
    """Convert a document to a layer.

    Args:
        data: the .mtlx file. path: of the new layer.
    Returns:
        An Sdf.Layer.
    Raises:
        SceneError: it is damaged, defines entities, or has too many nodes; or MaterialX is not installed.
    """
    from pxr import Sdf, Tf, Usd, UsdShade

    try:
        document, _ = parse_materialx(data)
    except MaterialError as error:
        raise SceneError(str(error)) from None
    layer = Sdf.Layer.CreateNew(path)
    stage = Usd.Stage.Open(layer)
    stage.DefinePrim("/MaterialX")
    stage.DefinePrim(ROOT)
    writer = _NodeWriter(stage)
    for element in document.getMaterialNodes():
        material = UsdShade.Material.Define(stage, f"{ROOT}/{Tf.MakeValidIdentifier(element.getName())}")
        shader = connected_node(element, "surfaceshader")
        if shader is not None:
            output = writer.write(DocumentNode(shader), str(material.GetPath()), "out", 0)
            material.CreateSurfaceOutput("mtlx").ConnectToSource(output)
    return layer


class _NodeWriter:
    """Writes the nodes of one document into a stage."""

    def __init__(self, stage: Any) -> None:
        self._stage, self._num_nodes = stage, 0

    def write(self, node: DocumentNode, parent: str, output: str, depth: int) -> Any:
        """Write a node and all before it; return its output.

        Args:
            parent: path of the prim to put it into. output: name of the output. depth: nodes behind it.
        Raises:
            SceneError: there are too many nodes.
        """
        from pxr import Sdf, Tf, UsdShade

        self._num_nodes += 1
        if self._num_nodes > MAX_NODES or depth > MAX_DEPTH:
            raise SceneError(f"it has more than {MAX_NODES:,} nodes, or loops; simplify it")
        name = Tf.MakeValidIdentifier(node.element.getNamePath())
        shader = UsdShade.Shader.Define(self._stage, f"{parent}/{name}")
        if not shader.GetIdAttr().HasAuthoredValue():
            shader.CreateIdAttr(f"ND_{node.category}_{node.type}")
            for element in node.element.getInputs():
                if element.getType() in _USD_TYPES:
                    kind = getattr(Sdf.ValueTypeNames, _USD_TYPES[element.getType()])
                    usd_input = shader.CreateInput(Tf.MakeValidIdentifier(element.getName()), kind)
                    self._write_input(usd_input, element.getType(), DocumentPort(element), node, parent, depth)
        return shader.CreateOutput(Tf.MakeValidIdentifier(output or "out"), Sdf.ValueTypeNames.Token)

    def _write_input(
        self, usd_input: Any, kind: str, port: DocumentPort, node: DocumentNode, parent: str, depth: int
    ) -> None:
        """Connect an input to its node, or set its value and color space."""
        try:
            source = port.node()
            if source is not None:
                usd_input.ConnectToSource(self.write(source[0], parent, source[1], depth + 1))
                return
            value: Any = port.text() if kind in ("string", "filename") else port.numbers()
        except UnsupportedNodeError:
            usd_input.GetAttr().AddConnection(f"{parent}/missing.outputs:out")  # the reader of the stage warns of it
            return
        if isinstance(value, tuple):
            if len(value) != getattr(usd_input.GetTypeName().type.pythonClass, "dimension", 1):
                return
            value = value[0] if len(value) == 1 else value
        usd_input.Set(value)
        if port.color_space() and (port.is_color or (kind == "filename" and node.type.startswith("color"))):
            usd_input.GetAttr().SetColorSpace(port.color_space())
