"""The pages of stored figures, docs/performance.md and docs/accuracy.md, and their files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

# an installed package has no pages
DOCS = next((folder for folder in Path(__file__).resolve().parents if (folder / "docs").is_dir()), Path()) / "docs"
PAGES = ("performance", "accuracy")


def stored_figures() -> dict[str, dict[str, Any]]:
    """Entries of both pages by name; an installed package has none."""
    files = [DOCS / f"{page}.json" for page in PAGES]
    pages = (json.loads(file.read_text(encoding="utf-8")) for file in files if file.is_file())
    return {entry["name"]: entry for page in pages for entry in page}


def find_document(name: str) -> str:
    """Page and file of a figure, by name without suffix."""
    return (
        "accuracy"
        if name.startswith(
            (
                "accuracy.",
                "reference.",
                "paper.",
                "pca.",
                "gather.rmse",
                "gather.full",
                "assets.",
                "export.",
                "glass.",
                "roughness.",
                "lens.",
                "mirror.",
                "sharp.peak",
                "sharp.rmse",
                "sharp.speckle",
                "sharp.static",
                "sharp.moving",
                "lights.groups_rmse",
                "lights.rmse",
                "solve.error",
                "free_camera.rmse",
                "free_camera.blots",
                "free_camera.all_rmse",
                "free_camera.correction",
                "btf.compression_error",
                "btf.compression_flat",
                "btf.compression_ratio",
                "btf.geometry",
                "btf.moving",
                "btf.sphere",
                "btf.table",
            )
        )
        or name == "frame.incremental_rmse"
        else "performance"
    )


def value_text(figure: dict[str, Any]) -> str:
    """Value, standard error and unit of a figure; errors in percent."""
    if figure["value"] is None:
        return "not measured"
    if figure["unit"] == "relative RMSE" and figure["value"] > 1e-4:
        return f"{100 * figure['value']:.2f}{_spread(figure, 100)} %"
    return f"{figure['value']:.3g}{_spread(figure)} {figure['unit'].replace('ratio', '×')}"


def _spread(figure: dict[str, Any], scale: float = 1.0) -> str:
    """Standard error of an estimate, to two digits."""
    error = figure.get("standard_error")
    return "" if error is None else f" ± {scale * error:.2g}"
