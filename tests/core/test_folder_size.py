"""Sizes of folders, also while somebody deletes them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from relume.core.folder_size import folder_bytes

_WALK = os.walk


def _two_folders(parent: Path) -> Path:
    for name, size in (("kept", 3), ("deleted", 5)):
        (parent / name).mkdir()
        (parent / name / "0").write_bytes(bytes(size))
    return parent


def test_all_files_below_a_folder_are_counted(tmp_path: Path) -> None:
    assert folder_bytes(_two_folders(tmp_path)) == 8
    assert folder_bytes(tmp_path / "none") == 0


def test_a_folder_deleted_while_it_is_measured_counts_as_empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def deleted_meanwhile(folder: Path, **how: Any) -> Iterator[tuple[str, list[str], list[str]]]:
        walk = _WALK(folder, **how)
        yield next(walk)
        shutil.rmtree(folder / "deleted")
        yield from walk

    monkeypatch.setattr(os, "walk", deleted_meanwhile)
    assert folder_bytes(_two_folders(tmp_path)) == 3
