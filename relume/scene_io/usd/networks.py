"""Inputs of shaders, followed through their networks to constants, images and primvars.

UsdUVTexture with UsdTransform2d and UsdPrimvarReader, and the nodes of MaterialX that say the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from relume.core.color import srgb_decode
from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.scene_io.gltf.uvs import UvTransform

Numbers = tuple[float, ...]
MAX_DEPTH = 32  # nodes between an input and its image
WRAPS = {
    "repeat": "repeat", "mirror": "mirror", "clamp": "clamp", "black": "clamp", "useMetadata": "repeat",
    "periodic": "repeat", "constant": "clamp",
}  # fmt: skip
SRGB = {"srgb", "srgb_texture", "g22_rec709", "srgb_rec709_scene"}
RAW = {"raw", "linear", "lin_rec709", "lin_srgb", "none", "data", "scene-linear rec.709-srgb", "lin_rec709_scene"}
CHANNELS = {"r": (0,), "g": (1,), "b": (2,), "a": (3,), "rgb": (0, 1, 2)}


@dataclass(frozen=True)
class Sample:
    """Channels of an image, times a scale plus a bias.

    Attributes:
        asset: key of the file in the stage. channels: of RGBA. scale, bias: of RGBA.
        color_space: "srgb", "raw", or "auto" if the file does not say.
        uv_name: primvar with the texture coordinates. transform: of them, as in glTF, v from the top.
        fallback: value without the image; None for the input's default.
    """

    asset: str
    channels: tuple[int, ...] = (0, 1, 2)
    color_space: str = "auto"
    scale: Numbers = (1.0, 1.0, 1.0, 1.0)
    bias: Numbers = (0.0, 0.0, 0.0, 0.0)
    wrap: tuple[str, str] = ("repeat", "repeat")
    uv_name: str = "st"
    transform: UvTransform = field(default_factory=UvTransform)
    fallback: Numbers | None = None


@dataclass(frozen=True)
class PrimvarReference:
    """Values of a primvar of the mesh; `fallback` without it."""

    name: str
    fallback: Numbers | None = None


Value = Numbers | str | Sample | PrimvarReference | None


def transform_2d(scale: Numbers, degrees: float, translation: Numbers) -> UvTransform:
    """UsdTransform2d, st′ = R S st + t with t upward, for texture coordinates with v from the top.

    Args:
        scale: S. degrees: of R, counterclockwise. translation: t.
    """
    angle = np.radians(degrees)
    (sx, sy), (tx, ty) = scale, translation
    offset = (float(tx - np.sin(angle) * sy), float(1 - np.cos(angle) * sy - ty))
    return UvTransform(offset=offset, rotation=float(angle), scale=(sx, sy))


class NetworkReader:
    """Reads the inputs of one material's shaders.

    Args:
        time: a UsdTimeCode. label: names the material in warnings.
        warnings: gets a sentence for each node that is not supported.
    """

    def __init__(self, time: Any, label: str, warnings: list[ImporterWarning]) -> None:
        self._time, self._label, self._warnings = time, label, warnings
        self._readers: dict[str, Callable[[Any, str, int], Value]] = {
            "UsdUVTexture": self._uv_texture,
            "UsdPrimvarReader": self._primvar_reader,
            "ND_image": self._image,
            "ND_tiledimage": self._image,
            "ND_gltf_image": self._image,
            "ND_normalmap": self._normal_map,
            "ND_constant": lambda shader, _, depth: self.read(shader, "value", depth),
            "ND_convert": lambda shader, _, depth: self.read(shader, "in", depth),
            "ND_dot": lambda shader, _, depth: self.read(shader, "in", depth),
            "ND_multiply": self._multiply,
            "ND_separate": self._separate,
            "ND_geompropvalue": self._geometry_property,
        }

    def read(self, shader: Any, name: str, depth: int = 0) -> Value:
        """Read an input; None if it has no value.

        Args:
            shader: a UsdShade.ConnectableAPI or Shader. name: of the input. depth: number of nodes behind.
        """
        from pxr import UsdShade

        usd_input = shader.GetInput(name)
        if not usd_input or depth > MAX_DEPTH:
            return None
        for attribute in UsdShade.Utils.GetValueProducingAttributes(usd_input):
            if UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Input:
                return self._constant(attribute)
            node = UsdShade.Shader(attribute.GetPrim())
            return self._read_node(node, UsdShade.Output(attribute).GetBaseName(), name, depth)
        sources = usd_input.GetRawConnectedSourcePaths()
        if any(not shader.GetPrim().GetStage().GetPrimAtPath(path.GetPrimPath()) for path in sources):
            self._warn(name, "is connected to nothing that exists")
        return None if sources else self._constant(usd_input.GetAttr())

    def numbers(self, shader: Any, name: str, default: Numbers, depth: int = 0) -> Numbers:
        """Read an input that must be constant.

        Args:
            shader, name, depth: as in `read`. default: value without a constant.
        """
        value = self.read(shader, name, depth)
        if isinstance(value, tuple) and len(value) == len(default):
            return value
        if value is not None:
            self._warn(name, "varies, which isn't supported here")
        return default

    def text(self, shader: Any, name: str, default: str = "", depth: int = 0) -> str:
        """Read an input with a name or path.

        Args:
            shader, name, depth: as in `read`. default: value without one.
        """
        value = self.read(shader, name, depth)
        return value if isinstance(value, str) and value else default

    def _constant(self, attribute: Any) -> Value:
        value = attribute.Get(self._time)
        if value is None:
            return None
        if hasattr(value, "path"):
            return str(value.path)
        if isinstance(value, str):
            return value
        try:
            numbers = np.asarray(value, np.float64).reshape(-1)
        except (TypeError, ValueError):
            return None
        if not np.isfinite(numbers).all() or not 1 <= len(numbers) <= 16:
            self._warn(attribute.GetBaseName(), "is not a finite number")
            return None
        if len(numbers) == 3 and attribute.HasColorSpace() and attribute.GetColorSpace().lower() in SRGB:
            numbers = srgb_decode(np.clip(numbers, 0, 1).astype(np.float32)).astype(np.float64)
        return tuple(float(f"{number:.7g}") for number in numbers.tolist())  # of single precision, as people wrote it

    def _read_node(self, node: Any, output: str, name: str, depth: int) -> Value:
        identifier = str(node.GetIdAttr().Get(self._time) or "")
        kind = identifier.removeprefix("ND_") if identifier.startswith("ND_Usd") else identifier
        reader = next((reader for prefix, reader in self._readers.items() if kind.startswith(prefix)), None)
        if reader is None:
            self._warn(
                name, f"comes from the node {quote(identifier or node.GetPrim().GetName())}, which isn't supported"
            )
            return None
        return reader(node, output, depth + 1)

    def _warn(self, name: str, reason: str) -> None:
        self._warnings.append(unsupported(f"{quote(name)} of {self._label} {reason}; it has its default."))

    def _uv_texture(self, shader: Any, output: str, depth: int) -> Value:
        asset = self.text(shader, "file", depth=depth)
        fallback = self.numbers(shader, "fallback", (0.0, 0.0, 0.0, 1.0), depth)
        channels = CHANNELS.get(output, (0, 1, 2))
        has_fallback = bool(shader.GetInput("fallback"))
        constant = tuple(fallback[channel] for channel in channels) if has_fallback else None
        if not asset:
            self._warnings.append(unsupported(f"A texture of {self._label} has no file."))
            return constant
        wraps = [self.text(shader, name, "useMetadata", depth) for name in ("wrapS", "wrapT")]
        if "black" in wraps:
            message = f"A texture of {self._label} is black outside its image in the file; its edge is extended."
            self._warnings.append(approximated(message))
        uv_name, transform = self._coordinates(shader, "st", depth)
        return Sample(
            asset,
            channels,
            self._color_space(shader, "file", self.text(shader, "sourceColorSpace", "auto", depth)),
            self.numbers(shader, "scale", (1.0, 1.0, 1.0, 1.0), depth),
            self.numbers(shader, "bias", (0.0, 0.0, 0.0, 0.0), depth),
            (WRAPS.get(wraps[0], "repeat"), WRAPS.get(wraps[1], "repeat")),
            uv_name,
            transform,
            constant,
        )

    def _color_space(self, shader: Any, name: str, source: str) -> str:
        """Color space of an image: as its texture node says, else as the metadata of its path."""
        from pxr import UsdShade

        if source.lower() == "auto":
            for attribute in UsdShade.Utils.GetValueProducingAttributes(shader.GetInput(name)):
                source = attribute.GetColorSpace() if attribute.HasColorSpace() else source
        source = source.lower()
        if source in SRGB or source in RAW or source == "auto":
            return "srgb" if source in SRGB else "raw" if source in RAW else "auto"
        message = f"The color space {quote(source)} of a texture of {self._label} isn't supported; it is guessed."
        self._warnings.append(unsupported(message))
        return "auto"

    def _coordinates(self, shader: Any, name: str, depth: int) -> tuple[str, UvTransform]:
        """Primvar and transform of the texture coordinates of a node."""
        from pxr import UsdShade

        usd_input = shader.GetInput(name)
        attributes = UsdShade.Utils.GetValueProducingAttributes(usd_input) if usd_input else []
        node = UsdShade.Shader(attributes[0].GetPrim()) if attributes else None
        identifier = str(node.GetIdAttr().Get(self._time) or "") if node else ""
        if node is None or not identifier or depth > MAX_DEPTH:
            return "st", UvTransform()
        if "PrimvarReader" in identifier:
            return self.text(node, "varname", "st", depth + 1), UvTransform()
        if identifier.startswith("ND_geompropvalue"):
            return self.text(node, "geomprop", "st", depth + 1), UvTransform()
        if identifier.startswith("ND_texcoord"):
            index = int(self.numbers(node, "index", (0.0,), depth + 1)[0])
            return "st" if index == 0 else f"st{index}", UvTransform()
        is_place = identifier.startswith("ND_place2d")
        if not is_place and "Transform2d" not in identifier:
            self._warn("texture coordinates", f"come from the node {quote(identifier)}, which isn't supported")
            return "st", UvTransform()
        uv_name, inner = self._coordinates(node, "texcoord" if is_place else "in", depth + 1)
        if inner != UvTransform():
            self._warn("texture coordinates", "have several transforms, of which the last is used")
        if not is_place:
            scale = self.numbers(node, "scale", (1.0, 1.0), depth + 1)
            (degrees,) = self.numbers(node, "rotation", (0.0,), depth + 1)
            return uv_name, transform_2d(scale, degrees, self.numbers(node, "translation", (0.0, 0.0), depth + 1))
        return uv_name, self._place_2d(node, depth + 1)

    def _place_2d(self, node: Any, depth: int) -> UvTransform:
        """ND_place2d: (st - pivot) / scale, rotated clockwise, - offset, + pivot."""
        sx, sy = self.numbers(node, "scale", (1.0, 1.0), depth)
        (degrees,) = self.numbers(node, "rotate", (0.0,), depth)
        offset, pivot = (np.array(self.numbers(node, name, (0.0, 0.0), depth)) for name in ("offset", "pivot"))
        scale = (1 / sx if sx else 1.0, 1 / sy if sy else 1.0)
        angle = np.radians(-degrees)
        rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        tx, ty = (pivot - offset - rotation @ (np.array(scale) * pivot)).tolist()
        return transform_2d(scale, -degrees, (tx, ty))

    def _primvar_reader(self, shader: Any, output: str, depth: int) -> Value:
        fallback = self.read(shader, "fallback", depth)
        name = self.text(shader, "varname", depth=depth)
        return PrimvarReference(name, fallback if isinstance(fallback, tuple) else None)

    def _geometry_property(self, shader: Any, output: str, depth: int) -> Value:
        fallback = self.read(shader, "default", depth)
        name = self.text(shader, "geomprop", depth=depth)
        return PrimvarReference(name, fallback if isinstance(fallback, tuple) else None)

    def _image(self, shader: Any, output: str, depth: int) -> Value:
        """ND_image and ND_tiledimage: st · tiling - offset."""
        asset = self.text(shader, "file", depth=depth)
        fallback = self.read(shader, "default", depth)
        constant = fallback if isinstance(fallback, tuple) else None
        if not asset:
            self._warnings.append(unsupported(f"A texture of {self._label} has no file."))
            return constant
        identifier = str(shader.GetIdAttr().Get(self._time))
        num_channels = {"float": 1, "vector2": 2}.get(identifier.rsplit("_", 1)[-1], 3)
        uv_name, transform = self._coordinates(shader, "texcoord", depth)
        tiling = self.numbers(shader, "uvtiling", (1.0, 1.0), depth)
        right, up = self.numbers(shader, "uvoffset", (0.0, 0.0), depth)
        if tiling != (1.0, 1.0) or right or up:
            transform = transform_2d(tiling, 0.0, (-right, -up))
        wraps = [self.text(shader, name, "periodic", depth) for name in ("uaddressmode", "vaddressmode")]
        return Sample(
            asset,
            tuple(range(num_channels)),
            self._color_space(shader, "file", "auto"),
            wrap=(WRAPS.get(wraps[0], "repeat"), WRAPS.get(wraps[1], "repeat")),
            uv_name=uv_name,
            transform=transform,
            fallback=constant,
        )

    def _normal_map(self, shader: Any, output: str, depth: int) -> Value:
        """ND_normalmap: bytes are (n + 1) / 2."""
        value = self.read(shader, "in", depth)
        if not isinstance(value, Sample):
            return None
        strength = self.numbers(shader, "scale", (1.0,), depth)[0]
        scale = (2 * strength, 2 * strength, 2.0, 1.0)
        return replace(value, scale=scale, bias=(-strength, -strength, -1.0, 0.0), color_space="raw")

    def _multiply(self, shader: Any, output: str, depth: int) -> Value:
        """A product, of which one factor at least is constant."""
        first, second = (self.read(shader, name, depth) for name in ("in1", "in2"))
        if isinstance(second, Sample):
            first, second = second, first
        if isinstance(first, tuple) and isinstance(second, tuple):
            return tuple(np.atleast_1d(np.multiply(first, second)).tolist())
        if isinstance(first, Sample) and isinstance(second, tuple):
            factor = np.ones(4)
            factor[: len(second) if len(second) > 1 else 4] = second
            scale, bias = (tuple((np.array(row) * factor).tolist()) for row in (first.scale, first.bias))
            return replace(first, scale=scale, bias=bias)
        self._warn(output, "is a product of two images, which isn't supported")
        return first

    def _separate(self, shader: Any, output: str, depth: int) -> Value:
        """One channel of a color or vector."""
        value = self.read(shader, "in", depth)
        channel = {"outr": 0, "outx": 0, "outg": 1, "outy": 1, "outb": 2, "outz": 2, "outa": 3, "outw": 3}.get(
            output, 0
        )
        if isinstance(value, Sample):
            return replace(value, channels=(channel,))
        return (value[channel],) if isinstance(value, tuple) and channel < len(value) else None
