"""Pointers into a look: which curve or parameter is meant."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from relume.brdf.registry import TERMS
from relume.brdf.term import Curve
from relume.errors import ParameterError
from relume.transfer.pointer import ROTATION

_POINTER = r"^/materials/(?P<material>[^/]+)/terms/(?P<term>0|[1-9]\d{0,2})/%s/(?P<name>[a-z_0-9]+)$"
CURVE, PARAMETER = re.compile(_POINTER % "curves"), re.compile(_POINTER % "params")


def find_curve(pointer: str, document: Mapping[str, Any]) -> tuple[dict[str, Any], Curve]:
    """The term that a curve pointer means, and the curve's declaration, whether it is drawn by hand or not.

    Raises:
        ParameterError: there is no such curve in this look.
    """
    term, name = _term(CURVE.match(pointer), document)
    curves = {curve.name: curve for curve in TERMS[term["model"]].settled(term).curves} if term else {}
    if term is None or name not in curves:
        raise ParameterError("curve", pointer, "a pointer like /materials/Teapot/terms/1/curves/theta_h of this look")
    return term, curves[name]


def check_parameter(pointer: str, document: Mapping[str, Any]) -> None:
    """Raises ParameterError where there is no such parameter in this look; the environment's rotation counts as one."""
    if pointer == ROTATION:
        return
    term, name = _term(PARAMETER.match(pointer), document)
    if term is None or name not in {parameter.name for parameter in TERMS[term["model"]].parameters}:
        raise ParameterError("parameter", pointer, "a pointer like /materials/Teapot/terms/1/params/ior of this look")


def _term(match: re.Match[str] | None, document: Mapping[str, Any]) -> tuple[dict[str, Any] | None, str]:
    """The term that a pointer goes into, where there is one, and the name at its end."""
    if match is None:
        return None, ""
    material = document["materials"].get(match["material"].replace("~1", "/").replace("~0", "~"))
    terms: list[dict[str, Any]] = material["terms"] if material else []
    index = int(match["term"])
    return terms[index] if index < len(terms) else None, match["name"]
