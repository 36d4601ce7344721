"""Library materials as terms of a look, from the data file that `relume.look.library.merl_fits` writes.

The numbers are converted from the published fits of Ngan 2005 and Low 2012 to the MERL measurements (Matusik 2003). A
preset has no texture: the fit includes the color.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from relume.brdf.registry import TERMS

DATA = Path(__file__).with_name("merl_fits.json")

SOURCES = {
    "low": "Löw et al. 2012, E2 fit to MERL",
    "ngan": "Ngan et al. 2005, fit to MERL",
}


@dataclass(frozen=True)
class Preset:
    """One material of the library under one model.

    Attributes:
        id: "table/material". model: model of the highlight.
        group: metal, plastic, paint, fabric, wood, stone or rubber.
        swatch: color under uniform light, "#rrggbb". terms: as in a look.
    """

    id: str
    name: str
    group: str
    model: str
    source: str
    swatch: str
    terms: list[dict[str, Any]]


def make_preset_terms(model: str, numbers: list[float]) -> list[dict[str, Any]]:
    """Return the terms for one row: diffuse RGB, highlight RGB, and the model's parameters in order."""
    names = [parameter.name for parameter in TERMS[model].parameters]
    params = dict(zip(names, numbers[6:], strict=True))
    return [
        {"model": "lambert", "color": numbers[:3], "texture": None, "params": {}, "curves": {}},
        {"model": model, "color": numbers[3:6], "texture": None, "params": params, "curves": {}},
    ]


@cache
def presets() -> tuple[Preset, ...]:
    """All library materials under all models that were fitted to them."""
    return read_presets(json.loads(DATA.read_text(encoding="utf-8")))


def read_presets(data: dict[str, Any]) -> tuple[Preset, ...]:
    """Read the presets from a data file's content."""
    return tuple(
        Preset(
            id=f"{table}/{material}",
            name=material.replace("-", " ").capitalize(),
            group=data["materials"][material]["group"],
            model=rows["model"],
            source=SOURCES[table.partition("_")[0]],
            swatch=data["materials"][material]["swatch"],
            terms=make_preset_terms(rows["model"], numbers),
        )
        for table, rows in data["tables"].items()
        for material, numbers in rows["materials"].items()
    )
