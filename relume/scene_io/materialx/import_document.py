"""Import of MaterialX documents: surfaces whose inputs are constants and images, see `node_values`.

Documents are upgraded to version 1.39 by the library MaterialX, an optional dependency. Other files than images in the
document's folder, archive or upload are never read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from relume.core.errors import MaterialError
from relume.core.import_warnings import ImporterWarning, ignored, quote, unsupported
from relume.scene_io.gltf.materials import ReadMaterial
from relume.scene_io.materialx.image_nodes import IMAGE_NODES
from relume.scene_io.materialx.node_values import TOO_COMPLEX, Element, NodeValues, UnsupportedNodeError
from relume.scene_io.materialx.safe_xml import check_xml
from relume.scene_io.obj_ply.material_maker import read_companion
from relume.scene_io.referenced_files import Companions
from relume.scene_io.surfaces.gltf_pbr import gltf_pbr
from relume.scene_io.surfaces.make_material import SurfaceMaterials
from relume.scene_io.surfaces.open_pbr import open_pbr
from relume.scene_io.surfaces.preview_surface import preview_surface
from relume.scene_io.surfaces.standard_surface import standard_surface
from relume.scene_io.surfaces.surface_images import SurfaceImages
from relume.scene_io.surfaces.surface_inputs import SurfaceInputs, Value

MODELS = {
    "open_pbr_surface": open_pbr,
    "standard_surface": standard_surface,
    "gltf_pbr": gltf_pbr,
    "UsdPreviewSurface": preview_surface,
}
MAX_MATERIALS = 200
_NORMALS = ("normal", "geometry_normal")
_UNUSED = ("tangent", "geometry_tangent", "coat_normal", "geometry_coat_normal", "geometry_coat_tangent")


@dataclass(frozen=True)
class MaterialXDocument:
    """The materials of a document.

    Attributes:
        materials: in the order of the document, with unique names.
        warnings: a sentence for each feature that is read otherwise than the document says.
    """

    materials: tuple[ReadMaterial, ...]
    warnings: tuple[ImporterWarning, ...]


def import_materialx(data: bytes, companions: Companions) -> MaterialXDocument:
    """Import the materials of a .mtlx file.

    Args:
        data: the file. companions: the images that it may name.
    Raises:
        MaterialError: it is damaged, too large, or has no material; or MaterialX is not installed.
        SceneError: its images are too large.
    """
    warnings = [
        ignored(f"The included file {quote(name)} wasn't read; definitions of MaterialX are built in.")
        for name in check_xml(data)
    ]
    document = _parse(data)
    images = SurfaceImages(lambda name, label: read_companion(companions, "", name, label, warnings), warnings)
    values, maker = NodeValues(IMAGE_NODES, warnings), SurfaceMaterials(images, warnings)
    materials = list[ReadMaterial]()
    for name, shader in _surfaces(document, warnings):
        if len(materials) == MAX_MATERIALS:
            raise MaterialError(f"the .mtlx file has more than {MAX_MATERIALS} materials; split it")
        label = f"material {quote(name)}"
        inputs = SurfaceInputs(_input_values(shader, values, label, warnings), images, label, warnings)
        materials.append(maker.make(name, MODELS[shader.getCategory()](inputs)))
    maker.warn_occlusion_maps()
    if not materials:
        reasons = " ".join(warnings)
        raise MaterialError(
            f"the .mtlx file has no material that can be shown; give one of {', '.join(MODELS)}. {reasons}".strip()
        )
    return MaterialXDocument(tuple(materials), tuple(warnings))


def _parse(data: bytes) -> Any:
    try:
        import MaterialX as mx  # optional, and slow to import  # noqa: N813
    except ImportError:
        raise MaterialError("MaterialX isn't installed; run pip install relume[materialx]") from None
    options = mx.XmlReadOptions()
    options.readXIncludeFunction = None
    document = mx.createDocument()
    try:
        mx.readFromXmlString(document, data.decode("utf-8-sig"), mx.FileSearchPath(), options)
    except UnicodeDecodeError:
        raise MaterialError("the .mtlx file isn't UTF-8; save it as UTF-8") from None
    except (mx.Exception, RuntimeError, LookupError) as error:
        raise MaterialError(f"MaterialX can't read the .mtlx file ({str(error)[:200]}); export it again") from None
    return document


def _surfaces(document: Any, warnings: list[ImporterWarning]) -> Iterator[tuple[str, Element]]:
    """Names and shaders of all materials; without a material, those of the shaders."""
    materials = document.getMaterialNodes()
    shaders = [(material.getName(), _connected(material, "surfaceshader")) for material in materials]
    if not materials:
        shaders = [(node.getName(), node) for node in document.getNodes() if node.getType() == "surfaceshader"]
    for name, shader in shaders:
        if shader is None:
            warnings.append(unsupported(f"Left out material {quote(name)}: it has no surface shader."))
        elif shader.getCategory() not in MODELS:
            category = quote(shader.getCategory())
            warnings.append(unsupported(f"Left out material {quote(name)}: its shader {category} isn't supported."))
        else:
            yield name, shader
    warnings += [
        unsupported(f"Displacement of material {quote(material.getName())} isn't supported.")
        for material in materials
        if _connected(material, "displacementshader") is not None
    ]


def _connected(material: Element, name: str) -> Element | None:
    port = material.getInput(name)
    return None if port is None else port.getConnectedNode()


def _input_values(shader: Element, values: NodeValues, label: str, warnings: list[ImporterWarning]) -> dict[str, Value]:
    """The values of a shader's inputs; those that cannot be read are left out, with a warning."""
    results = dict[str, Value]()
    for port in shader.getInputs():
        name = port.getName()
        try:
            value = values.value(port)
        except (UnsupportedNodeError, RecursionError) as error:
            reason = TOO_COMPLEX if isinstance(error, RecursionError) else error
            warnings.append(unsupported(f"{name} of {label} has its default: {reason}."))
            continue
        if value is not None and name in _UNUSED:
            warnings.append(unsupported(f"{name} of {label} isn't supported."))
        elif value is not None:
            results[name] = value
    return results
