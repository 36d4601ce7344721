"""Folders on the disk."""

from __future__ import annotations

from pathlib import Path


def folder_bytes(folder: Path) -> int:
    """What the files in a folder take, those of its folders too; nothing where there is none."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
