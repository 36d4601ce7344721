"""Export of a scene with a look to a file, whose suffix is its format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from relume.core.errors import ParameterError
from relume.export.export_document import ExportDocument
from relume.export.export_report import ExportReport, make_report, omitted_from_scene_files
from relume.export.write_glb import omitted_from_glb, write_glb
from relume.export.write_light_mix import omitted_from_light_mix, write_light_mix
from relume.export.write_materialx import omitted_from_materialx, write_materialx
from relume.export.write_usd import omitted_from_usd, write_usd


class ExportFormat(NamedTuple):
    """A file format.

    Attributes:
        suffix: of its files. label, media_type: shown to users, and sent with downloads.
        omitted: returns sentences about what a file does not have. write: writes it, atomically.
        has_materials: it has the materials of the scene, and further looks as their variants.
    """

    suffix: str
    label: str
    media_type: str
    omitted: Callable[[ExportDocument], tuple[str, ...]]
    write: Callable[[ExportDocument, Path], None]
    has_materials: bool = True


FORMATS = {
    "glb": ExportFormat(".glb", "glTF", "model/gltf-binary", omitted_from_glb, write_glb),
    "materialx": ExportFormat(".zip", "MaterialX", "application/zip", omitted_from_materialx, write_materialx),
    "usd": ExportFormat(".usdz", "USD", "model/vnd.usdz+zip", omitted_from_usd, write_usd),
    "light_mix": ExportFormat(
        ".json", "light mix", "application/json", omitted_from_light_mix, write_light_mix, has_materials=False
    ),
}


def format_of(path: Path) -> ExportFormat:
    """Return the format of a file name. Raises ParameterError."""
    name = path.name.lower()
    for each in FORMATS.values():
        if name.endswith(each.suffix):
            return each
    suffixes = ", ".join(each.suffix for each in FORMATS.values())
    raise ParameterError("the export format", path.suffix, f"a file name ending in {suffixes}")


def export_report(export: ExportDocument, file_format: ExportFormat) -> ExportReport:
    """Return the errors of an export, and what its file will not have."""
    omitted = export.warnings + file_format.omitted(export)
    return make_report(export, omitted + omitted_from_scene_files(export) if file_format.has_materials else omitted)
