"""Store of imported materials, in `relume.assets.asset_store`.

    <folder>/<id>/material.json    name, materials with their partial looks, and warnings

The id is the hash of the looks, whose images are in the image store. Looks do not refer to imported materials: applying
one copies its terms.
"""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from relume.assets.asset_store import MAX_JSON_BYTES, AssetStore
from relume.brdf.term_validation import complete_term
from relume.core.errors import MaterialError, SceneError
from relume.core.import_warnings import ImporterWarning, by_severity, warning_of
from relume.imported_materials.library_look import library_look
from relume.scene_io.materialx.import_document import import_materialx
from relume.scene_io.referenced_files import Companions, NoFiles
from relume.scene_io.zip_scene import open_zip

STORE = AssetStore("imported material", "imported:", "material.json", MaterialError, max_entries=500)
SUFFIXES = (".mtlx",)
MAX_FILE_BYTES = 512 << 20


@dataclass(frozen=True)
class LibraryMaterial:
    """One material of a file. look: `terms`, and `normal_map` and `glass` if it has them, as in a look."""

    name: str
    look: dict[str, Any]

    @property
    def terms(self) -> list[dict[str, Any]]:
        """Complete terms."""
        return [complete_term(("imported", k), term, None) for k, term in enumerate(self.look["terms"])]


@dataclass(frozen=True)
class ImportedRecord:
    """An imported file in lists.

    Attributes:
        created: seconds since 1970.
        materials: in the order of the file.
        warnings: a sentence for each feature that looks otherwise than in the file.
    """

    id: str
    name: str
    created: float
    materials: tuple[LibraryMaterial, ...]
    warnings: tuple[ImporterWarning, ...]


def store_materials(
    folder: Path, images: Path, source: Path, name: str, companions: Companions | None = None
) -> ImportedRecord:
    """Import the materials of a .mtlx file, or of a .zip with one and its images.

    Args:
        folder: folder of the asset store. images: folder of the image store.
        source: the file.
        name: shown to users.
        companions: the images that a .mtlx may name; None for none.
    Raises:
        MaterialError: the file is unusable, or a store is full.
    """
    try:
        document = _read_looks(images, source, companions or NoFiles())
    except SceneError as error:
        raise MaterialError(str(error)) from error
    text = json.dumps(document, sort_keys=True)
    if len(text) > MAX_JSON_BYTES // 2:
        raise MaterialError("the file has too many materials for one import; split it")
    with tempfile.TemporaryDirectory() as unfinished:
        content = Path(unfinished) / "materials.json"
        content.write_text(text)
        return get_record(folder, STORE.store(folder, content, name, lambda _: document))


def _read_looks(images: Path, source: Path, companions: Companions) -> dict[str, Any]:
    """The fields of the record."""
    if source.stat().st_size > MAX_FILE_BYTES:
        raise MaterialError(f"the file has more than {MAX_FILE_BYTES >> 20} MB; scale its images down")
    data = source.read_bytes()
    if data.startswith(b"PK"):
        data, companions = open_zip(data, SUFFIXES, "MaterialX")
    imported = import_materialx(data, companions)
    warnings = list(imported.warnings)
    materials = [
        {"name": read.material.name, "look": library_look(read, images, warnings)} for read in imported.materials
    ]
    return {"materials": materials, "warnings": [warning.document() for warning in by_severity(warnings)]}


def records(folder: Path) -> list[ImportedRecord]:
    """Return all imported files of a folder, newest first."""
    return STORE.records(folder, get_record)


def get_record(folder: Path, identity: str) -> ImportedRecord:
    """Return one imported file. Raises NotFoundError; MaterialError if it is damaged."""
    path = STORE.path(folder, identity)
    document = STORE.load_record(path)
    try:
        materials = tuple(_material(fields) for fields in document["materials"])
        warnings = tuple(map(warning_of, document["warnings"]))
    except (KeyError, TypeError, ValueError) as error:
        raise STORE.damaged_error(path) from error
    return ImportedRecord(identity, document["name"], document["created"], materials, warnings)


def _material(fields: dict[str, Any]) -> LibraryMaterial:
    name, look = fields["name"], fields["look"]
    if not isinstance(name, str) or not isinstance(look["terms"], list):
        raise TypeError
    return LibraryMaterial(name, look)
