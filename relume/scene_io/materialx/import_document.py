"""Import of MaterialX documents: surfaces whose inputs are constants and images.

Documents are upgraded to version 1.39 by the library MaterialX, an optional dependency. Other files than images in the
document's folder, archive or upload are never read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from relume.core.errors import MaterialError
from relume.core.import_warnings import ImporterWarning, ignored, quote, unsupported
from relume.scene_io.materialx.document_nodes import DocumentPort, Element
from relume.scene_io.materialx.safe_xml import check_xml
from relume.scene_io.obj_ply.material_maker import printable, read_companion
from relume.scene_io.referenced_files import Companions
from relume.scene_io.surfaces.image_nodes import IMAGE_NODES
from relume.scene_io.surfaces.make_material import ReadMaterial, SurfaceMaterials
from relume.scene_io.surfaces.models import MODELS, SurfaceReader, warn_black_outside
from relume.scene_io.surfaces.node_values import NodeValues
from relume.scene_io.surfaces.surface_images import SurfaceImages, first_tile

MAX_MATERIALS = 200


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
    document, included = parse_materialx(data)
    warnings = [
        ignored(f"The included file {quote(name)} wasn't read; definitions of MaterialX are built in.")
        for name in included
    ]
    images = SurfaceImages(_DocumentImages(companions, warnings), warnings)
    reader, maker = (
        SurfaceReader(NodeValues(IMAGE_NODES, warnings), images, warnings),
        SurfaceMaterials(images, warnings),
    )
    materials = list[ReadMaterial]()
    for name, shader in _surfaces(document, warnings):
        if len(materials) == MAX_MATERIALS:
            raise MaterialError(f"the .mtlx file has more than {MAX_MATERIALS} materials; split it")
        ports = [(port.getName(), DocumentPort(port)) for port in shader.getInputs()]
        label = f"material {quote(name)}"
        surface = reader.read(shader.getCategory(), ports, label)
        warn_black_outside(surface, label, warnings)
        materials.append(maker.make(name, surface))
    maker.warn_occlusion_maps()
    if not materials:
        reasons = " ".join(warnings)
        raise MaterialError(
            f"the .mtlx file has no material that can be shown; give one of {', '.join(MODELS)}. {reasons}".strip()
        )
    return MaterialXDocument(tuple(materials), tuple(warnings))


@dataclass(frozen=True)
class _DocumentImages:
    """Images of a document, relative to it."""

    companions: Companions
    warnings: list[ImporterWarning]

    def read(self, file: str, label: str) -> bytes | None:
        """See `DocumentFiles.read`."""
        return read_companion(self.companions, "", first_tile(file, self.warnings), label, self.warnings)

    def printable_name(self, file: str) -> str:
        """See `DocumentFiles.printable_name`."""
        return printable(file)


def parse_materialx(data: bytes) -> tuple[Any, list[str]]:
    """The MaterialX document of a .mtlx file, and the files that it includes, which are not read.

    Raises:
        MaterialError: it is damaged or too large, or MaterialX is not installed.
    """
    included = check_xml(data)
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
    return document, included


def _surfaces(document: Any, warnings: list[ImporterWarning]) -> Iterator[tuple[str, Element]]:
    """Names and shaders of all materials; without a material, those of the shaders."""
    materials = document.getMaterialNodes()
    shaders = [(material.getName(), connected_node(material, "surfaceshader")) for material in materials]
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
        if connected_node(material, "displacementshader") is not None
    ]


def connected_node(material: Element, name: str) -> Element | None:
    """The node that an input of a material is connected to; None if there is none."""
    port = material.getInput(name)
    return None if port is None else port.getConnectedNode()
