"""Extensions that are not supported, wherever they stand in a file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from relume.core.import_warnings import ImporterWarning, ignored, quote, unsupported
from relume.scene_io.gltf.animation import POINTER
from relume.scene_io.gltf.compression import DRACO, MESHOPT
from relume.scene_io.gltf.document import Document
from relume.scene_io.gltf.images import UNREADABLE_FORMATS
from relume.scene_io.gltf.material_extensions import MATERIAL_EXTENSIONS
from relume.scene_io.gltf.nodes import VISIBILITY

SUPPORTED_EXTENSIONS = {
    DRACO,
    *MESHOPT,
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_variants",
    VISIBILITY,
    POINTER,  # has its own sentence
    *MATERIAL_EXTENSIONS,
}
NOT_VISIBLE = (
    *("KHR_xmp", "KHR_animation", "KHR_audio", "KHR_physics", "KHR_interactivity", "KHR_node_", "OMI_", "VRM"),
    *("EXT_structural", "EXT_mesh_features", "EXT_instance_features", "MSFT_audio", "FB_ngon_encoding"),
)
"""Starts of the names of extensions that do not change the image of the rest pose."""


def warn_unknown_extensions(document: Document, warnings: list[ImporterWarning]) -> None:
    """Add a sentence for each extension of the objects that were read which is not supported.

    Extensions of materials have their own sentences, and so have images of unreadable formats.

    Args:
        document: document of the file, after everything was read. warnings: gets the sentences.
    """
    handled = SUPPORTED_EXTENSIONS | UNREADABLE_FORMATS.keys()
    labels: dict[str, list[str]] = {name: ["the file"] for name in document.root.extensions if name not in handled}
    for label, content in document.used():
        for name in _names(content, is_material=label.startswith("material ")):
            if name not in handled and label not in labels.setdefault(name, []):
                labels[name].append(label)
    required = [name for name in document.root.extensionsRequired if name not in handled]
    warnings.extend(
        unsupported(f"The file requires {quote(name)}, which isn't supported; it may look wrong.") for name in required
    )
    for name in sorted(labels.keys() - set(required)):
        more = f" and {len(labels[name]) - 1:,} more" if len(labels[name]) > 1 else ""
        grade = ignored if name.startswith(NOT_VISIBLE) else unsupported
        effect = "it does not change the image" if grade is ignored else "it may look different"
        warnings.append(grade(f"Extension {quote(name)} of {labels[name][0]}{more} isn't supported; {effect}."))


def _names(content: Any, *, is_material: bool) -> Iterator[str]:
    """Names of the extensions of an object and of the objects in it."""
    stack, is_outermost = [content], True
    while stack:
        item = stack.pop()
        if isinstance(item, list):
            stack.extend(item if item and isinstance(item[0], dict) else [])
        elif isinstance(item, dict):
            extensions = item.get("extensions")
            if isinstance(extensions, dict) and not (is_outermost and is_material):
                yield from extensions
            stack.extend(value for key, value in item.items() if key != "extras" and isinstance(value, (dict, list)))
        is_outermost = False
