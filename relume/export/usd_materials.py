"""Principled surfaces as materials of USD: UsdPreviewSurface, and OpenPBR for renderers that read MaterialX."""

from __future__ import annotations

from math import degrees
from typing import Any

import numpy as np

from relume.brdf.fresnel import normal_reflectance
from relume.export.export_images import ExportImages
from relume.export.export_materials import ExportMaterial
from relume.export.open_pbr_inputs import ADDRESS_MODES, IMAGE_FOLDER, open_pbr_inputs, place2d_inputs
from relume.math.uv_transform import UvTransform
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Color, Value, scaled
from relume.scene_io.surfaces.surface_parameters import WHITE, SurfaceParameters

_SURFACE = "ND_open_pbr_surface_surfaceshader"


class UsdMaterials:
    """Defines materials on a stage. files: images that they name, in order."""

    def __init__(self, stage: Any, images: ExportImages) -> None:
        self._stage, self._images = stage, images
        self.files: dict[str, None] = {}

    def define(self, path: Any, material: ExportMaterial) -> Any:
        """Define a material at a path, with both shaders; return its UsdShade.Material."""
        from pxr import UsdShade

        prim = UsdShade.Material.Define(self._stage, path)
        prim.CreateSurfaceOutput().ConnectToSource(self._preview(path, material.surface).ConnectableAPI(), "surface")
        inputs = open_pbr_inputs(material, self._images)
        prim.CreateSurfaceOutput("mtlx").ConnectToSource(self._open_pbr(path, inputs).ConnectableAPI(), "out")
        extras = {"error": float(material.error), "omitted": " ".join(material.omitted)}
        prim.GetPrim().SetCustomDataByKey("relume", extras)
        return prim

    def _shader(self, path: Any, name: str, identifier: str) -> Any:
        from pxr import UsdShade

        shader = UsdShade.Shader.Define(self._stage, path.AppendChild(name))
        shader.CreateIdAttr(identifier)
        return shader

    def _preview(self, path: Any, surface: SurfaceParameters) -> Any:
        shader = self._shader(path, "PreviewSurface", "UsdPreviewSurface")
        coordinates = self._shader(path, "st", "UsdPrimvarReader_float2")
        _set(coordinates, "varname", "String", "st")
        for name, value in _preview_inputs(surface).items():
            self._set_preview(shader, coordinates, name, value)
        from pxr import Sdf

        shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        return shader

    def _set_preview(self, shader: Any, coordinates: Any, name: str, value: Value) -> None:
        """Set an input, or connect the texture that it shows."""
        from pxr import Sdf

        kind = "Normal3f" if name == "normal" else "Int" if name == "useSpecularWorkflow" else "Float"
        kind = "Color3f" if name.endswith("Color") else kind
        if not isinstance(value, ImageInput):
            _set(shader, name, kind, value)
            return
        texture = self._shader(shader.GetPath().GetParentPath(), f"{name}_texture", "UsdUVTexture")
        factor = np.array(value.factor)
        is_normal = name == "normal"
        scale = (2 * factor[0], 2 * factor[0], 2.0, 1.0) if is_normal else (*factor, 1.0)
        bias = (-factor[0], -factor[0], -1.0, 0.0) if is_normal else (0.0, 0.0, 0.0, 0.0)
        _set(texture, "file", "Asset", self._asset(value))
        _set(texture, "sourceColorSpace", "Token", "sRGB" if value.is_srgb else "raw")
        for axis, wrap in zip("ST", value.wrap, strict=True):
            _set(texture, f"wrap{axis}", "Token", wrap)
        _set(texture, "scale", "Float4", tuple(map(float, scale)))
        _set(texture, "bias", "Float4", tuple(map(float, bias)))
        placed = self._placed(coordinates, value.transform)
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(placed)
        channel = "rgb" if value.channel == "rgb" else "r"
        types = Sdf.ValueTypeNames
        result = texture.CreateOutput(channel, types.Float3 if channel == "rgb" else types.Float)
        shader.CreateInput(name, getattr(types, kind)).ConnectToSource(result)

    def _placed(self, coordinates: Any, uv: UvTransform) -> Any:
        """Output of texture coordinates with a transform, the same for all images of a material."""
        from pxr import Sdf

        kind = Sdf.ValueTypeNames.Float2
        output = coordinates.CreateOutput("result", kind)
        if uv == UvTransform():
            return output
        transform = self._shader(coordinates.GetPath().GetParentPath(), "st_transform", "UsdTransform2d")
        transform.CreateInput("in", kind).ConnectToSource(output)
        _set(transform, "scale", "Float2", uv.scale)
        _set(transform, "rotation", "Float", degrees(uv.rotation))
        _set(transform, "translation", "Float2", uv.translation_from_bottom)
        return transform.CreateOutput("result", kind)

    def _open_pbr(self, path: Any, inputs: dict[str, Value]) -> Any:
        from pxr import Sdf

        shader = self._shader(path, "OpenPbr", _SURFACE)
        shader.CreateOutput("out", Sdf.ValueTypeNames.Token)
        for name, value in inputs.items():
            kind = "Float3" if name == "geometry_normal" else "Color3f" if _is_color(value) else "Float"
            if isinstance(value, ImageInput):
                port = shader.CreateInput(name, getattr(Sdf.ValueTypeNames, kind))
                port.ConnectToSource(self._image(path, name, value, kind))
            elif name == "geometry_thin_walled":
                _set(shader, name, "Bool", bool(value))
            else:
                _set(shader, name, kind, value)
        return shader

    def _image(self, path: Any, name: str, value: ImageInput, kind: str) -> Any:
        """Output of an image, times its factor; of a normal map its normals."""
        from pxr import Sdf

        type_name = {"Float3": "vector3", "Color3f": "color3", "Float": "float"}[kind]
        image = self._shader(path, f"{name}_image", f"ND_image_{type_name}")
        _set(image, "file", "Asset", self._asset(value))
        image.GetInput("file").GetAttr().SetColorSpace("srgb_texture" if value.is_srgb else "raw")
        for axis, wrap in zip("uv", value.wrap, strict=True):
            _set(image, f"{axis}addressmode", "String", ADDRESS_MODES[wrap])
        if value.transform != UvTransform():
            image.CreateInput("texcoord", Sdf.ValueTypeNames.Float2).ConnectToSource(
                self._place2d(path, value.transform)
            )
        value_type = getattr(Sdf.ValueTypeNames, kind)
        output = image.CreateOutput("out", value_type)
        if kind == "Float3":
            node, source = self._shader(path, f"{name}_map", "ND_normalmap_float"), "in"
            _set(node, "scale", "Float", value.factor[0])
        elif value.factor == WHITE:
            return output
        else:
            node, source = self._shader(path, f"{name}_scaled", f"ND_multiply_{type_name}"), "in1"
            _set(node, "in2", kind, value.factor if kind == "Color3f" else value.factor[0])
        node.CreateInput(source, value_type).ConnectToSource(output)
        return node.CreateOutput("out", value_type)

    def _place2d(self, path: Any, uv: UvTransform) -> Any:
        """Output of transformed texture coordinates, the same for all images of a material."""
        from pxr import Sdf

        kind = Sdf.ValueTypeNames.Float2
        coordinates = self._shader(path, "texcoord", "ND_texcoord_vector2")
        place = self._shader(path, "place2d", "ND_place2d_vector2")
        place.CreateInput("texcoord", kind).ConnectToSource(coordinates.CreateOutput("out", kind))
        for name, value in place2d_inputs(uv).items():
            _set(place, name, "Float" if name == "rotate" else "Float2", value)
        return place.CreateOutput("out", kind)

    def _asset(self, value: ImageInput) -> str:
        self.files[value.file] = None
        return f"./{IMAGE_FOLDER}/{value.file}"


def omitted_from_preview(material: ExportMaterial) -> bool:
    """True if UsdPreviewSurface lacks features that OpenPBR has."""
    surface = material.surface
    has_sheen = surface.sheen_color != (0.0, 0.0, 0.0)
    return has_sheen or surface.anisotropy > 0 or surface.thickness > 0 or surface.specular != 1


def _preview_inputs(surface: SurfaceParameters) -> dict[str, Value]:
    inputs: dict[str, Value] = {
        "diffuseColor": surface.base_color,
        "roughness": surface.roughness,
        "clearcoat": surface.clearcoat,
        "clearcoatRoughness": surface.clearcoat_roughness,
        "ior": surface.ior,
        "emissiveColor": _scaled_color(surface.emission, surface.emission_strength),
    }
    if surface.specular == 1 and surface.specular_color == WHITE:
        inputs["metallic"] = surface.metallic
    else:
        weight = surface.specular if isinstance(surface.specular, float) else 1.0
        f0 = weight * normal_reflectance(surface.ior)
        inputs |= {"useSpecularWorkflow": 1.0, "specularColor": _scaled_color(surface.specular_color, f0)}
    if surface.transmission != 0 and isinstance(surface.transmission, float):
        inputs["opacity"] = 1 - surface.transmission
    elif surface.alpha_mode != "OPAQUE":
        inputs["opacity"] = surface.alpha
    if surface.alpha_mode == "MASK":
        inputs["opacityThreshold"] = surface.alpha_cutoff
    if surface.normal is not None:
        inputs["normal"] = surface.normal
    return inputs


def _scaled_color(color: Color, factor: float) -> Color:
    return scaled(color, (factor, factor, factor))


def _is_color(value: Value) -> bool:
    return isinstance(value, tuple) or (isinstance(value, ImageInput) and value.channel == "rgb")


def _set(shader: Any, name: str, kind: str, value: Any) -> None:
    from pxr import Sdf

    if kind == "Int":
        value = int(value)
    shader.CreateInput(name, getattr(Sdf.ValueTypeNames, kind)).Set(value)
