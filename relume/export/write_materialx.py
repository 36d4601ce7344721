"""MaterialX documents of exports: an OpenPBR Surface for each material, in a zip with its images."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

from relume.core.errors import SceneError
from relume.core.filesystem import atomic_write
from relume.export.export_document import ExportDocument
from relume.export.export_images import ExportImages
from relume.export.export_materials import ExportMaterial
from relume.export.open_pbr_inputs import (
    ADDRESS_MODES,
    IMAGE_FOLDER,
    omitted_from_open_pbr,
    open_pbr_inputs,
    place2d_inputs,
)
from relume.math.uv_transform import UvTransform
from relume.scene_io.surfaces.surface_images import ImageInput
from relume.scene_io.surfaces.surface_inputs import Value
from relume.scene_io.surfaces.surface_parameters import WHITE

DOCUMENT = "materials.mtlx"


def omitted_from_materialx(export: ExportDocument) -> tuple[str, ...]:
    """Sentences about what a MaterialX document does not have."""
    sentences = (sentence for material in export.all_materials() for sentence in omitted_from_open_pbr(material))
    return ("Geometry, lights and cameras are not part of MaterialX.", *sentences)


def write_materialx(export: ExportDocument, path: Path) -> None:
    """Write a zip with a document and its images, atomically.

    Args:
        export: the scene and its materials. path: ends in .zip.
    Raises:
        SceneError: MaterialX is not installed, or does not validate the document.
        DiskFullError, RelumeError: the file cannot be written.
    """
    text, files = materialx_document(export)
    with atomic_write(path) as unfinished, zipfile.ZipFile(unfinished, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(DOCUMENT, text)
        for file in files:  # one in memory at a time
            archive.writestr(f"{IMAGE_FOLDER}/{file}", export.images.png(file))


def materialx_document(export: ExportDocument) -> tuple[str, list[str]]:
    """Return the text of the document, and the images that it names.

    Raises:
        SceneError: MaterialX is not installed, or does not validate the document.
    """
    mx = _library()
    document = mx.createDocument()
    writer = _MaterialWriter(document, export.images)
    looks: dict[int, str] = {}
    for name, materials in export.variants.items():
        for material in materials:
            looks.setdefault(id(material), name)
    own = {id(material) for material in export.materials}
    for material in export.all_materials():
        writer.add(material, None if id(material) in own else looks[id(material)])
    definitions = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), definitions)
    document.setDataLibrary(definitions)
    is_valid, message = document.validate()
    if not is_valid:
        raise SceneError(f"the MaterialX document is not valid ({message[:200]}); export the scene as .glb")
    return str(mx.writeToXmlString(document)), list(writer.files)


def _library() -> Any:
    try:
        import MaterialX
    except ImportError:
        raise SceneError("MaterialX isn't installed; run pip install relume[materialx]") from None
    return MaterialX


class _MaterialWriter:
    """Adds materials to a document. files: images that they name, in order."""

    def __init__(self, document: Any, images: ExportImages) -> None:
        self._mx, self._document, self._images = _library(), document, images
        self.files: dict[str, None] = {}

    def add(self, material: ExportMaterial, look: str | None) -> None:
        """Add a material. look: the variant that has it; None for the exported look."""
        label = material.name if look is None else f"{material.name} {look}"
        name = self._document.createValidChildName(f"M_{self._mx.createValidName(label)}")
        shader = self._document.addNode("open_pbr_surface", f"{name}_surface", "surfaceshader")
        for key, value in open_pbr_inputs(material, self._images).items():
            self._set(shader, name, key, value)
        node = self._document.addNode("surfacematerial", name, "material")
        node.addInput("surfaceshader", "surfaceshader").setNodeName(shader.getName())
        node.setDocString(f"{label}; relative error {material.error:.4f}. {' '.join(material.omitted)}".strip())

    def _set(self, shader: Any, name: str, key: str, value: Value) -> None:
        """Set an input, or connect the image that it shows."""
        if isinstance(value, ImageInput):
            type_name = "color3" if value.channel == "rgb" else "float"
            node = self._normals(name, value) if key == "geometry_normal" else self._image(name, key, value, type_name)
            port = shader.addInput(key, "vector3" if key == "geometry_normal" else type_name)
            port.setNodeName(node.getName())
        elif isinstance(value, tuple):
            shader.setInputValue(key, self._mx.Color3(*value), "color3")
        elif key == "geometry_thin_walled":
            shader.setInputValue(key, bool(value), "boolean")
        else:
            shader.setInputValue(key, float(value), "float")

    def _image(self, name: str, key: str, value: ImageInput, type_name: str) -> Any:
        """An image, times its factor."""
        image = self._document.addNode("image", f"{name}_{key}", type_name)
        file = image.addInput("file", "filename")
        file.setValueString(f"{IMAGE_FOLDER}/{value.file}")
        if value.is_srgb:
            file.setColorSpace("srgb_texture")
        for axis, wrap in zip("uv", value.wrap, strict=True):
            image.setInputValue(f"{axis}addressmode", ADDRESS_MODES[wrap], "string")
        if value.transform != UvTransform():
            image.addInput("texcoord", "vector2").setNodeName(self._placed(name, value.transform))
        self.files[value.file] = None
        if value.factor == WHITE or type_name == "vector3":
            return image
        product = self._document.addNode("multiply", f"{name}_{key}_scaled", type_name)
        product.addInput("in1", type_name).setNodeName(image.getName())
        factor = self._mx.Color3(*value.factor) if type_name == "color3" else float(value.factor[0])
        product.setInputValue("in2", factor, type_name)
        return product

    def _placed(self, name: str, uv: UvTransform) -> str:
        """Name of the node of transformed texture coordinates, the same for all images of a material."""
        place = self._document.getNode(f"{name}_place2d")
        if place is None:
            coordinates = self._document.addNode("texcoord", f"{name}_texcoord", "vector2")
            place = self._document.addNode("place2d", f"{name}_place2d", "vector2")
            place.addInput("texcoord", "vector2").setNodeName(coordinates.getName())
            for key, value in place2d_inputs(uv).items():
                if key == "rotate":
                    place.setInputValue(key, float(value), "float")
                else:
                    place.setInputValue(key, self._mx.Vector2(*value), "vector2")
        return str(place.getName())

    def _normals(self, name: str, value: ImageInput) -> Any:
        image = self._image(name, "geometry_normal", value, "vector3")
        normals = self._document.addNode("normalmap", f"{name}_normalmap", "vector3")
        normals.addInput("in", "vector3").setNodeName(image.getName())
        normals.setInputValue("scale", float(value.factor[0]), "float")
        return normals
