"""Nodes that read image files: `image`, `tiledimage`, and those of glTF."""

from __future__ import annotations

from dataclasses import replace

from relume.core.import_warnings import quote
from relume.scene_io.materialx.node_values import Element, NodeValues, UnsupportedNodeError
from relume.scene_io.materialx.texture_coordinates import ONE, ZERO, Placement
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Rgb, scaled

_WHITE = (1.0, 1.0, 1.0)
_WRAPS = {"mirror": "mirror", "clamp": "clamp", "constant": "clamp"}  # others repeat
_COORDINATES = ("texcoord", "geompropvalue")


def image(values: NodeValues, node: Element, output: str) -> ImageInput:
    """The image of a node `image` or `tiledimage`: u′ = (u · tiling − offset) · tile size / image size.

    Args:
        values: evaluate its inputs. node: the node. output: the name of its output.
    """
    u, v = values.pair(node, "uvoffset", ZERO)
    width, height = values.pair(node, "realworldimagesize", ONE)
    tile_width, tile_height = values.pair(node, "realworldtilesize", ONE)
    placement = _placement(values, node, "texcoord").then(values.pair(node, "uvtiling", ONE), (-u, -v))
    return _read(values, node, placement.then((tile_width / (width or 1), tile_height / (height or 1)), ZERO))


def gltf_image(values: NodeValues, node: Element, output: str) -> ImageInput:
    """The image of a node `gltf_image` or `gltf_normalmap`. See `image`."""
    return _scaled(_gltf_image(values, node, 0), values.numbers(node, "factor", _WHITE))


def gltf_colorimage(values: NodeValues, node: Element, output: str) -> ImageInput:
    """The color of a node `gltf_colorimage`, or its opacity. See `image`."""
    read = _gltf_image(values, node, 1)
    if output == "outa":
        return replace(read, channel="a", default=None)
    read = _scaled(read, values.numbers(node, "color", _WHITE))
    return _scaled(read, values.numbers(node, "geomcolor", _WHITE))


def _scaled(read: ImageInput, factor: Rgb) -> ImageInput:
    product = scaled(read, factor)
    assert isinstance(product, ImageInput)
    return product


def _gltf_image(values: NodeValues, node: Element, default_order: int) -> ImageInput:
    """Scale and offset are those of glTF, as if v ran from the top."""
    u_scale, v_scale = values.pair(node, "scale", ONE)
    u, v = values.pair(node, "offset", ZERO)
    _warn_rotation(values, node)
    placement = _placement(values, node, "texcoord").place2d(
        values.pair(node, "pivot", (0.0, 1.0)),
        (1 / (u_scale or 1), 1 / (v_scale or 1)),
        (-u, v),
        offset_first=_is_offset_first(values, node, default_order),
    )
    return _read(values, node, placement)


def _read(values: NodeValues, node: Element, placement: Placement) -> ImageInput:
    port = node.getInput("file")
    source = None if port is None else values.source(port)
    file = "" if source is None else source.getResolvedValueString()
    if not file:
        raise UnsupportedNodeError(f"node {quote(node.getName())} has no file")
    is_color = node.getType().startswith("color") or node.getCategory() == "gltf_colorimage"
    has_default = node.getInput("default") is not None
    return ImageInput(
        file,
        "r" if node.getType() == "float" else "rgb",
        is_color and values.is_srgb(source),
        wrap=(_wrap(node, "uaddressmode"), _wrap(node, "vaddressmode")),
        transform=placement.uv_transform(),
        default=values.numbers(node, "default", (0.0, 0.0, 0.0)) if has_default else None,
    )


def _wrap(node: Element, name: str) -> str:
    port = node.getInput(name)
    return "repeat" if port is None else _WRAPS.get(port.getValueString(), "repeat")


def _placement(values: NodeValues, node: Element, name: str) -> Placement:
    """The transform of the texture coordinates that an input of a node has."""
    port = node.getInput(name)
    source = None if port is None else values.source(port)
    coordinates = None if source is None else source.getConnectedNode()
    category = "" if coordinates is None else coordinates.getCategory()
    if coordinates is None or category in _COORDINATES:
        return Placement()
    if category == "multiply":
        return _placement(values, coordinates, "in1").then(values.pair(coordinates, "in2", ONE), ZERO)
    if category != "place2d":
        values.warn(f"Texture coordinates of node {quote(coordinates.getName())} aren't supported; they are ignored.")
        return Placement()
    _warn_rotation(values, coordinates)
    return _placement(values, coordinates, "texcoord").place2d(
        values.pair(coordinates, "pivot", ZERO),
        values.pair(coordinates, "scale", ONE),
        values.pair(coordinates, "offset", ZERO),
        offset_first=_is_offset_first(values, coordinates, 0),
    )


def _is_offset_first(values: NodeValues, node: Element, default: int) -> bool:
    return values.pair(node, "operationorder", (float(default), 0.0))[0] == 1


def _warn_rotation(values: NodeValues, node: Element) -> None:
    if values.pair(node, "rotate", ZERO)[0]:
        values.warn(f"The rotation of node {quote(node.getName())} isn't supported; its image isn't rotated.")


IMAGE_NODES = {
    "image": image,
    "tiledimage": image,
    "gltf_image": gltf_image,
    "gltf_normalmap": gltf_image,
    "gltf_colorimage": gltf_colorimage,
}
