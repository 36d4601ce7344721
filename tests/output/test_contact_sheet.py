"""Contact sheets: images in their cells, labels below, bounded size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageFont

from relume.core.errors import CancelledError, DiskFullError, RelumeError
from relume.output.contact_sheet import CELL_WIDTH, GAP, LABEL_HEIGHT, write_contact_sheet

PAPER = 32


def images(folder: Path, *colors: tuple[int, ...], size: tuple[int, int] = (640, 480)) -> list[Path]:
    paths = [folder / f"{index}.png" for index in range(len(colors))]
    for path, color in zip(paths, colors, strict=True):
        Image.new("RGBA" if len(color) == 4 else "RGB", size, color).save(path)
    return paths


def test_each_image_is_in_its_cell_with_its_label_below(tmp_path: Path) -> None:
    paths = images(tmp_path, (255, 0, 0), (0, 255, 0), (0, 0, 255))
    write_contact_sheet(paths, ["Day", "", "Dusk"], tmp_path / "sheet.png")
    sheet = np.array(Image.open(tmp_path / "sheet.png"))
    height = CELL_WIDTH * 3 // 4
    row, column = height + LABEL_HEIGHT + GAP, CELL_WIDTH + GAP
    assert sheet.shape == (GAP + 2 * row, GAP + 2 * column, 3)
    for x, y, color in ((0, 0, (255, 0, 0)), (column, 0, (0, 255, 0)), (0, row, (0, 0, 255))):
        assert np.all(sheet[GAP + y : GAP + y + height, GAP + x : GAP + x + CELL_WIDTH] == color)
    below = slice(GAP + height, GAP + height + LABEL_HEIGHT)
    assert sheet[below, GAP : GAP + CELL_WIDTH].max() > 200
    assert np.all(sheet[below, GAP + column :] == PAPER)
    assert np.all(sheet[row + GAP :, GAP + column :] == PAPER)


def test_small_and_transparent_images_and_long_names_stay_in_their_cells(tmp_path: Path) -> None:
    paths = images(tmp_path, (255, 255, 255, 0), (255, 255, 255, 255), size=(40, 30))
    write_contact_sheet(paths, ["W" * 10_000, "\ud800🍎\n灯"], tmp_path / "sheet.png")
    sheet = np.array(Image.open(tmp_path / "sheet.png"))
    assert sheet.shape == (2 * GAP + 30 + LABEL_HEIGHT, 3 * GAP + 80, 3)
    assert np.all(sheet[GAP : GAP + 30, GAP : GAP + 40] == PAPER)
    assert np.all(sheet[:, GAP + 40 : GAP + 40 + GAP // 2] == PAPER)


@pytest.mark.parametrize("has_system_fonts", [False, True])
def test_letters_of_other_languages_are_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_system_fonts: bool
) -> None:
    """With any font; what it does not have is a question mark, and not nothing."""
    real = ImageFont.truetype

    def load(name: str, size: int) -> ImageFont.FreeTypeFont:
        if not has_system_fonts and not Path(name).is_absolute():
            raise OSError("cannot open resource")
        return real(name, size)

    monkeypatch.setattr(ImageFont, "truetype", load)
    letters = "aößé" + "灯?"
    paths = images(tmp_path, *[(0, 0, 0)] * len(letters), size=(60, 40))
    write_contact_sheet(paths, list(letters), tmp_path / "sheet.png")
    sheet = np.array(Image.open(tmp_path / "sheet.png"))
    row, column = 40 + LABEL_HEIGHT + GAP, 60 + GAP
    labels = {
        sheet[y + 40 + GAP : y + 40 + GAP + LABEL_HEIGHT, x : x + 60].tobytes()
        for x in range(GAP, 3 * column, column)
        for y in (0, row)
    }
    assert len(labels) >= len(letters) - 1
    assert all(len(set(label)) > 1 for label in labels)


def test_a_sheet_that_is_stopped_or_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (path,) = images(tmp_path, (1, 2, 3))
    with pytest.raises(CancelledError):
        write_contact_sheet([path], ["a"], tmp_path / "sheet.png", lambda: True)

    def fail(self: Image.Image, file: Path) -> None:
        Path(file).write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", fail)
    with pytest.raises(DiskFullError):
        write_contact_sheet([path], ["a"], tmp_path / "sheet.png")
    monkeypatch.undo()
    with pytest.raises(RelumeError):
        write_contact_sheet([path], ["a"], tmp_path / "missing" / "sheet.png")
    assert [file.name for file in tmp_path.iterdir()] == ["0.png"]
