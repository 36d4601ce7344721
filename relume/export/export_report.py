"""Report of an export: errors of fitted materials, and what a file does not have, known before it is written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from relume.core.import_warnings import quote
from relume.export.export_document import ExportDocument
from relume.export.export_materials import ExportMaterial
from relume.image_io.contrast import NEUTRAL_CONTRAST
from relume.image_io.white_balance import NEUTRAL_TEMPERATURE


@dataclass(frozen=True)
class MaterialReport:
    """A material of an export.

    Attributes:
        name: of the material. look: name of the variant; None for the exported look.
        is_exact: the file has the values of its terms. error: relative RMS error of cosine-weighted BRDF values.
        omitted: a sentence for each feature that the file does not have.
    """

    name: str
    look: str | None
    is_exact: bool
    error: float
    omitted: tuple[str, ...]

    def document(self) -> dict[str, Any]:
        """Convert to JSON."""
        fields = {"name": self.name, "look": self.look, "exact": self.is_exact, "error": self.error}
        return {**fields, "omitted": list(self.omitted)}


@dataclass(frozen=True)
class ExportReport:
    """Report of an export.

    Attributes:
        materials: all materials, those of variants only if they differ. omitted: sentences about the scene.
    """

    materials: tuple[MaterialReport, ...]
    omitted: tuple[str, ...]

    @property
    def fitted(self) -> tuple[MaterialReport, ...]:
        """The materials with an error, the largest first."""
        return tuple(sorted((m for m in self.materials if not m.is_exact), key=lambda m: -m.error))

    def sentences(self) -> list[str]:
        """Every difference between the look and the file as a sentence."""
        fits = [
            f"Material {quote(m.name)}{f' of look {quote(m.look)}' if m.look else ''} is fitted, error {m.error:.0%}."
            for m in self.fitted
        ]
        return [*fits, *(sentence for m in self.materials for sentence in m.omitted), *self.omitted]

    def document(self) -> dict[str, Any]:
        """Convert to JSON."""
        return {"materials": [material.document() for material in self.materials], "omitted": list(self.omitted)}


def make_report(export: ExportDocument, omitted: tuple[str, ...]) -> ExportReport:
    """Return the report of an export. omitted: sentences about the file."""
    own = [_report(material, None) for material in export.materials]
    differing = [
        _report(material, name)
        for name, materials in export.variants.items()
        for material, original in zip(materials, export.materials, strict=True)
        if material is not original
    ]
    return ExportReport((*own, *differing), omitted)


def _report(material: ExportMaterial, look: str | None) -> MaterialReport:
    return MaterialReport(material.name, look, material.is_exact, round(material.error, 4), material.omitted)


def omitted_from_scene_files(export: ExportDocument) -> tuple[str, ...]:
    """Sentences about a look that no file with materials has."""
    display, transport = export.look.display, export.look.transport
    sentences = {
        "Gobos of lights are not exported.": any(getattr(light, "gobo", None) for _, light in export.lights()),
        "Exposure and tone mapping are settings of the program that opens the file.": display.exposure != 0,
        "The white balance of the display is not exported.": (display.temperature, display.tint)
        != (NEUTRAL_TEMPERATURE, 0),
        "The contrast of the display is not exported.": display.contrast != NEUTRAL_CONTRAST,
        "The LUT of the display is not exported.": display.lut is not None,
        "All light paths are exported, not only those that the look shows.": transport.show != "all",
        "Variants replace materials; lights and environment are those of the exported look.": bool(export.variants),
    }
    return tuple(sentence for sentence, applies in sentences.items() if applies)
