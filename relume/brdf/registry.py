"""The list of BRDF terms. To add one: write its file beside this one and add it here; tests/brdf then run over it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from relume.brdf.ashikhmin_shirley import ASHIKHMIN_SHIRLEY
from relume.brdf.blinn_phong import BLINN_PHONG
from relume.brdf.cook_torrance import COOK_TORRANCE
from relume.brdf.ggx import GGX
from relume.brdf.lambert import LAMBERT
from relume.brdf.term import Curve, Term

TERMS: dict[str, Term] = {term.model: term for term in (LAMBERT, BLINN_PHONG, COOK_TORRANCE, GGX, ASHIKHMIN_SHIRLEY)}


def _describe_curve(curve: Curve) -> dict[str, Any]:
    return {
        "name": curve.name,
        "label": curve.label,
        "angle": curve.angle.name.lower(),
        "parameters": list(curve.parameters),
        "bands": curve.num_bands,
        "outgoing": curve.outgoing,
    }


def describe() -> list[dict[str, Any]]:
    """Every term as JSON for `GET /api/models`; the editor builds its sliders and curves from it."""
    return [
        {
            "model": term.model,
            "label": term.label,
            "help": term.help,
            "source": term.source,
            "texture": term.texture,
            "parameters": [asdict(parameter) for parameter in term.parameters],
            "curves": [_describe_curve(curve) for curve in term.curves],
        }
        for term in TERMS.values()
    ]
