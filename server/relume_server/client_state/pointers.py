"""Check pointers into a look: curves, and what active controls can change."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from relume.brdf.registry import TERMS
from relume.brdf.term import Curve
from relume.core.errors import ParameterError
from relume.live.fixed_camera.edit_pointers import (
    ColorPointer,
    CurvePointer,
    EnvironmentPointer,
    LightGroupPointer,
    LightPointer,
    ParameterPointer,
    TransportPointer,
    parse_curve,
    parse_pointer,
)


def find_curve(pointer: str, document: Mapping[str, Any]) -> tuple[dict[str, Any], Curve]:
    """Return the term and the declaration of a curve, edited or generated.

    Raises:
        ParameterError: the look has no such curve.
    """
    curve_pointer = parse_curve(pointer)
    term = _term(curve_pointer, document)
    curves = {curve.name: curve for curve in TERMS[term["model"]].normalized(term).curves} if term else {}
    if term is None or curve_pointer.name not in curves:
        raise ParameterError("curve", pointer, "a curve of this look, such as /materials/Teapot/terms/1/curves/theta_h")
    return term, curves[curve_pointer.name]


def check_parameter(pointer: str, document: Mapping[str, Any]) -> None:
    """Raise ParameterError if the look has no such parameter, light or field of the environment."""
    match parse_pointer(pointer):
        case ParameterPointer() as parameter:
            term = _term(parameter, document)
            exists = term is not None and parameter.name in {p.name for p in TERMS[term["model"]].parameters}
        case ColorPointer(material, term_index):
            exists = term_index < len(document["materials"].get(material, {"terms": ()})["terms"])
        case LightPointer(name):
            exists = name in document["lights"]
        case LightGroupPointer(name):
            exists = name in document["light_groups"]
        case EnvironmentPointer() | TransportPointer():
            exists = True
        case CurvePointer():
            exists = False
    if not exists:
        raise ParameterError(
            "parameter", pointer, "one of this look, such as /lights/Key or /materials/A/terms/0/params/ior"
        )


def check_active_pointer(pointer: str, document: Mapping[str, Any]) -> None:
    """Raise ParameterError if the look has neither such a curve nor such a parameter."""
    if isinstance(parse_pointer(pointer), CurvePointer):
        find_curve(pointer, document)
    else:
        check_parameter(pointer, document)


def _term(pointer: CurvePointer | ParameterPointer, document: Mapping[str, Any]) -> dict[str, Any] | None:
    """Term of a pointer, if there is one; a shadow catcher's terms are never visible."""
    material = document["materials"].get(pointer.material)
    terms: list[dict[str, Any]] = material["terms"] if material and not material.get("shadow_catcher") else []
    return terms[pointer.term] if pointer.term < len(terms) else None
