"""Nodes that read image files: `image`, `tiledimage`, those of glTF, and UsdUVTexture."""

from __future__ import annotations

from dataclasses import replace

from relume.core.import_warnings import quote
from relume.scene_io.surfaces.node_values import AUTO, NodeValues, Port, ShaderNode, UnsupportedNodeError, normal_vector
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Rgb, Value, scaled
from relume.scene_io.surfaces.texture_coordinates import ONE, ZERO, Placement

_WHITE = (1.0, 1.0, 1.0)
_WRAPS = {"mirror": "mirror", "clamp": "clamp", "constant": "clamp", "black": "clamp"}
_BLACK = ("constant", "black", "useMetadata")  # images have no metadata about it, and are black outside then
_UVS = ("texcoord", "geompropvalue", "UsdPrimvarReader")


def image(values: NodeValues, node: ShaderNode, output: str) -> ImageInput:
    """The image of a node `image` or `tiledimage`: u′ = (u · tiling − offset) · tile size / image size.

    Args:
        values: evaluate its inputs. node: the node. output: the name of its output.
    """
    u, v = values.pair(node, "uvoffset", ZERO)
    width, height = values.pair(node, "realworldimagesize", ONE)
    tile_width, tile_height = values.pair(node, "realworldtilesize", ONE)
    placement = _placement(values, node, "texcoord").then(values.pair(node, "uvtiling", ONE), (-u, -v))
    return _read(values, node, placement.then((tile_width / (width or 1), tile_height / (height or 1)), ZERO))


def gltf_image(values: NodeValues, node: ShaderNode, output: str) -> ImageInput:
    """The image of a node `gltf_image`. See `image`."""
    return _scaled(_gltf_image(values, node, 0), values.numbers(node, "factor", _WHITE))


def gltf_normalmap(values: NodeValues, node: ShaderNode, output: str) -> Value:
    """The normals of a node `gltf_normalmap`. See `image`."""
    return normal_vector(_gltf_image(values, node, 0), _WHITE)


def gltf_colorimage(values: NodeValues, node: ShaderNode, output: str) -> ImageInput:
    """The color of a node `gltf_colorimage`, or its opacity. See `image`."""
    read = _gltf_image(values, node, 1)
    if output == "outa":
        return replace(read, channel="a", default=None)
    read = _scaled(read, values.numbers(node, "color", _WHITE))
    return _scaled(read, values.numbers(node, "geomcolor", _WHITE))


def uv_texture(values: NodeValues, node: ShaderNode, output: str, wrap: str = "periodic") -> ImageInput:
    """The image of a node `UsdUVTexture`: texels · scale + bias, in linear values.

    Args:
        values, node, output: as in `image`. wrap: default of its wrap modes.
    """
    index = {"r": 0, "g": 1, "b": 2, "a": 3}.get(output)
    read = _read(values, node, _placement(values, node, "st"), ("wrapS", "wrapT"), wrap)
    factor, bias, fallback = (
        _components(node.port(name), default, index)
        for name, default in (("scale", 1.0), ("bias", 0.0), ("fallback", 0.0))
    )
    source = node.port("sourceColorSpace")
    space = AUTO if source is None else source.text().lower() or AUTO
    is_srgb = read.is_srgb if space == AUTO else values.is_srgb(space)
    default = fallback if node.port("fallback") is not None else None
    return replace(read, channel=output if index is not None else "rgb", is_srgb=is_srgb, factor=factor, bias=bias,
                   default=default)  # fmt: skip


def _components(port: Port | None, default: float, index: int | None) -> Rgb:
    """The first three of four numbers, or one of them three times."""
    numbers = () if port is None else port.numbers()
    numbers = numbers if len(numbers) == 4 else (default,) * 4
    red, green, blue = numbers[:3] if index is None else (numbers[index],) * 3
    return red, green, blue


def _scaled(read: ImageInput, factor: Rgb) -> ImageInput:
    product = scaled(read, factor)
    assert isinstance(product, ImageInput)
    return product


def _gltf_image(values: NodeValues, node: ShaderNode, default_order: int) -> ImageInput:
    """Scale, rotation and offset are those of glTF, as if v ran from the top."""
    u_scale, v_scale = values.pair(node, "scale", ONE)
    u, v = values.pair(node, "offset", ZERO)
    placement = _placement(values, node, "texcoord").place2d(
        values.pair(node, "pivot", (0.0, 1.0)),
        (1 / (u_scale or 1), 1 / (v_scale or 1)),
        (-u, v),
        -values.pair(node, "rotate", ZERO)[0],
        offset_first=_is_offset_first(values, node, default_order),
    )
    return _read(values, node, placement)


def _read(
    values: NodeValues,
    node: ShaderNode,
    placement: Placement,
    wraps: tuple[str, str] = ("uaddressmode", "vaddressmode"),
    wrap: str = "periodic",
) -> ImageInput:
    """The file of a node with its color space, wrap modes and default.

    Args:
        wraps: inputs with the wrap modes along u and v. wrap: their default.
    """
    port = node.port("file")
    file = "" if port is None else port.text()
    if port is None or not file:
        raise UnsupportedNodeError(f"node {quote(node.name)} has no file")
    is_color = node.type.startswith("color") or node.category in ("gltf_colorimage", "UsdUVTexture")
    modes = [values.text(node, name, wrap) for name in wraps]
    transform = placement.uv_transform()
    if transform is None:
        values.warn(f"The texture coordinates of node {quote(node.name)} are sheared; they are used as they are.")
        transform = Placement().uv_transform()
        assert transform is not None
    has_default = node.port("default") is not None
    return ImageInput(
        file,
        "r" if node.type == "float" else "rgb",
        values.is_srgb(port.color_space()) if is_color else False,
        wrap=(_WRAPS.get(modes[0], "repeat"), _WRAPS.get(modes[1], "repeat")),
        is_black_outside=any(mode in _BLACK for mode in modes),
        uv_set=placement.uv_set,
        transform=transform,
        default=values.numbers(node, "default", (0.0, 0.0, 0.0)) if has_default else None,
    )


def _placement(values: NodeValues, node: ShaderNode, name: str) -> Placement:
    """The transform of the texture coordinates that an input of a node has."""
    port = node.port(name)
    source = None if port is None else port.node()
    if source is None:
        return Placement()
    coordinates, category = source[0], source[0].category
    if category == "texcoord":
        index = round(values.pair(coordinates, "index", ZERO)[0])
        return Placement(f"st{index}" if index else "st")
    if category in _UVS:
        return Placement(values.text(coordinates, "geomprop") or values.text(coordinates, "varname", "st"))
    if category == "convert":
        return _placement(values, coordinates, "in")
    if category == "multiply":
        return _placement(values, coordinates, "in1").then(values.pair(coordinates, "in2", ONE), ZERO)
    if category == "add":
        return _placement(values, coordinates, "in1").then(ONE, values.pair(coordinates, "in2", ZERO))
    if category in ("rotate2d", "rotate3d"):
        return _placement(values, coordinates, "in").then(ONE, ZERO, -_rotation_about_z(values, coordinates))
    if category == "UsdTransform2d":
        return _placement(values, coordinates, "in").then(
            values.pair(coordinates, "scale", ONE),
            values.pair(coordinates, "translation", ZERO),
            values.pair(coordinates, "rotation", ZERO)[0],
        )
    if category != "place2d":
        values.warn(f"Texture coordinates of node {quote(coordinates.name)} aren't supported; they are ignored.")
        return Placement()
    return _placement(values, coordinates, "texcoord").place2d(
        values.pair(coordinates, "pivot", ZERO),
        values.pair(coordinates, "scale", ONE),
        values.pair(coordinates, "offset", ZERO),
        values.pair(coordinates, "rotate", ZERO)[0],
        offset_first=_is_offset_first(values, coordinates, 0),
    )


def _rotation_about_z(values: NodeValues, node: ShaderNode) -> float:
    """Degrees of a node `rotate2d` or `rotate3d`, clockwise; others than about ±z are a warning."""
    degrees = values.pair(node, "amount", ZERO)[0]
    if node.category == "rotate2d" or degrees == 0:
        return degrees
    x, y, z = values.numbers(node, "axis", (0.0, 1.0, 0.0))
    if x or y or not z:
        values.warn(f"The rotation of texture coordinates by node {quote(node.name)} isn't supported; it is ignored.")
        return 0.0
    return degrees if z > 0 else -degrees


def _is_offset_first(values: NodeValues, node: ShaderNode, default: int) -> bool:
    return values.pair(node, "operationorder", (float(default), 0.0))[0] == 1


IMAGE_NODES = {
    "image": image,
    "tiledimage": image,
    "gltf_image": gltf_image,
    "gltf_normalmap": gltf_normalmap,
    "gltf_colorimage": gltf_colorimage,
    "UsdUVTexture": uv_texture,
}
