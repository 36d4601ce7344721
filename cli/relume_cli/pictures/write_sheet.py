"""Contact sheets of rendered files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from relume.core.errors import Description, ParameterError
from relume.output.contact_sheet import MAX_IMAGES, write_contact_sheet

if TYPE_CHECKING:
    from relume_cli.pictures.plans import PlannedFile


def check_sheet(sheet: Path | None, planned_files: Sequence[PlannedFile]) -> None:
    """Raise ParameterError before hours of work if a contact sheet of the files cannot be written; None: no sheet."""
    if sheet is None:
        return
    if sheet.suffix.lower() != ".png" or not sheet.parent.is_dir():
        raise ParameterError("--contact-sheet", str(sheet), "a file name ending in .png, in a folder that exists")
    images = [path for path, _ in _images(planned_files)]
    if not all(path.suffix.lower() in (".png", ".webp") for path in images):
        raise ParameterError("--output", images[0].name, "PNG or WebP files for --contact-sheet, neither EXR nor video")
    if sheet.resolve() in (path.resolve() for path in images):
        raise ParameterError("--contact-sheet", str(sheet), "another name than those of the images")
    if len(images) > MAX_IMAGES:
        value = Description(f"of {len(images):,} images")
        raise ParameterError("--contact-sheet", value, f"at most {MAX_IMAGES} images")


def write_sheet(sheet: Path | None, planned_files: Sequence[PlannedFile]) -> None:
    """Write the contact sheet of rendered files; None: no sheet."""
    if sheet is not None:
        paths, labels = zip(*_images(planned_files), strict=True)
        write_contact_sheet(paths, labels, sheet)


def _images(planned_files: Sequence[PlannedFile]) -> list[tuple[Path, str]]:
    """Path and label of each image; frames have the names of their files."""
    has_views = len({planned_file.view for planned_file in planned_files}) > 1
    images = []
    for planned_file in planned_files:
        if planned_file.path.suffix.lower() == ".mp4":
            images.append((planned_file.path, planned_file.look))
            continue
        label = f"{planned_file.look}, {planned_file.view}" if has_views else planned_file.look
        images += [(path, f"{label}, {path.stem}") for path in planned_file.frames] or [(planned_file.path, label)]
    return images
