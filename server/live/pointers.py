"""Pointers into a look: which curve is meant."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from relume.brdf.registry import TERMS
from relume.brdf.term import Curve
from relume.errors import ParameterError

CURVE = re.compile(r"^/materials/(?P<material>[^/]+)/terms/(?P<term>0|[1-9]\d{0,2})/curves/(?P<curve>[a-z_]+)$")


def find_curve(pointer: str, document: Mapping[str, Any]) -> tuple[dict[str, Any], Curve]:
    """The term that a curve pointer means, and the curve's declaration, whether it is drawn by hand or not.

    Raises:
        ParameterError: there is no such curve in this look.
    """
    match = CURVE.match(pointer)
    term = _term(document, match["material"], int(match["term"])) if match else None
    curves = {curve.name: curve for curve in TERMS[term["model"]].settled(term).curves} if term else {}
    if match is None or term is None or match["curve"] not in curves:
        raise ParameterError("curve", pointer, "a pointer like /materials/Teapot/terms/1/curves/theta_h of this look")
    return term, curves[match["curve"]]


def _term(document: Mapping[str, Any], escaped_material: str, index: int) -> dict[str, Any] | None:
    material = document["materials"].get(escaped_material.replace("~1", "/").replace("~0", "~"))
    terms: list[dict[str, Any]] = material["terms"] if material else []
    return terms[index] if index < len(terms) else None
