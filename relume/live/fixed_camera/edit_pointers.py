"""JSON Pointers to editable controls: a curve or parameter of a term, a light, a field of the environment."""

from __future__ import annotations

import re
from dataclasses import dataclass

from relume.brdf.registry import TERMS
from relume.core.errors import ParameterError
from relume.look.model import EnvironmentLook, Look, TransportLook


@dataclass(frozen=True)
class _TermPointer:
    """A member of a term of a look."""

    material: str
    term: int
    name: str

    def _format(self, group: str) -> str:
        return f"/materials/{_escape(self.material)}/terms/{self.term}/{group}/{self.name}"


class CurvePointer(_TermPointer):
    """A curve of a look."""

    def __str__(self) -> str:
        return self._format("curves")


class ParameterPointer(_TermPointer):
    """A parameter of a term of a look."""

    def __str__(self) -> str:
        return self._format("params")


@dataclass(frozen=True)
class ColorPointer:
    """The color or texture of a term of a look: the fraction of light that it reflects."""

    material: str
    term: int
    field: str

    def __str__(self) -> str:
        return f"/materials/{_escape(self.material)}/terms/{self.term}/{self.field}"


@dataclass(frozen=True)
class TransportPointer:
    """A field of a look's transport."""

    field: str

    def __str__(self) -> str:
        return f"/transport/{self.field}"


@dataclass(frozen=True)
class LightPointer:
    """A light of a look."""

    name: str

    def __str__(self) -> str:
        return f"/lights/{_escape(self.name)}"


@dataclass(frozen=True)
class LightGroupPointer:
    """A light group of a look."""

    name: str

    def __str__(self) -> str:
        return f"/light_groups/{_escape(self.name)}"


@dataclass(frozen=True)
class EnvironmentPointer:
    """A field of a look's environment."""

    field: str

    def __str__(self) -> str:
        return f"/environment/{self.field}"


Pointer = (
    CurvePointer
    | ParameterPointer
    | ColorPointer
    | TransportPointer
    | LightPointer
    | LightGroupPointer
    | EnvironmentPointer
)

ROTATION = EnvironmentPointer("rotation")
_POINTER_TYPES: dict[str, type[CurvePointer] | type[ParameterPointer]] = {
    "curves": CurvePointer,
    "params": ParameterPointer,
}
_TERM = re.compile(
    r"/materials/(?P<material>[^/]+)/terms/(?P<term>0|[1-9][0-9]{0,2})/(?P<group>curves|params)/(?P<name>[a-z_0-9]+)"
)
_COLOR = re.compile(r"/materials/(?P<material>[^/]+)/terms/(?P<term>0|[1-9][0-9]{0,2})/(?P<field>color|texture)")
_TRANSPORT = re.compile(rf"/transport/(?P<field>{'|'.join(TransportLook.model_fields)})")
_LIGHT = re.compile(r"/lights/(?P<name>[^/]+)")
_LIGHT_GROUP = re.compile(r"/light_groups/(?P<name>[^/]+)")
_ENVIRONMENT = re.compile(rf"/environment/(?P<field>{'|'.join(EnvironmentLook.model_fields)})")


def parse_pointer(pointer: str) -> Pointer:
    """Parse a pointer.

    Raises:
        ParameterError: it does not point to an editable control.
    """
    if term := _TERM.fullmatch(pointer):
        return _POINTER_TYPES[term["group"]](_unescape(term["material"]), int(term["term"]), term["name"])
    if color := _COLOR.fullmatch(pointer):
        return ColorPointer(_unescape(color["material"]), int(color["term"]), color["field"])
    if transport := _TRANSPORT.fullmatch(pointer):
        return TransportPointer(transport["field"])
    if light := _LIGHT.fullmatch(pointer):
        return LightPointer(_unescape(light["name"]))
    if group := _LIGHT_GROUP.fullmatch(pointer):
        return LightGroupPointer(_unescape(group["name"]))
    if environment := _ENVIRONMENT.fullmatch(pointer):
        return EnvironmentPointer(environment["field"])
    raise ParameterError(
        "pointer",
        pointer,
        "a pointer such as /materials/NAME/terms/0/curves/theta_h, …/params/ior, …/color, /lights/NAME or "
        "/environment/rotation",
    )


def _escape(token: str) -> str:
    return token.replace("~", "~0").replace("/", "~1")


def _unescape(token: str) -> str:
    return token.replace("~1", "/").replace("~0", "~")


def parse_curve(pointer: str) -> CurvePointer:
    """Parse a pointer to a curve.

    Raises:
        ParameterError: it does not point to a curve.
    """
    parsed = parse_pointer(pointer)
    if not isinstance(parsed, CurvePointer):
        raise ParameterError("curve", pointer, "a pointer like /materials/NAME/terms/0/curves/theta_h")
    return parsed


def check_exists(pointer: CurvePointer | ParameterPointer, look: Look) -> None:
    """Raise ParameterError if a look has no such term, curve or parameter."""
    material = look.materials.get(pointer.material)
    if material is None or not 0 <= pointer.term < len(material.terms):
        raise ParameterError("pointer", str(pointer), "a term of this look")
    declared = TERMS[material.terms[pointer.term]["model"]]
    names = declared.curves if isinstance(pointer, CurvePointer) else declared.parameters
    if pointer.name not in [declaration.name for declaration in names]:
        raise ParameterError("pointer", str(pointer), "a curve or a parameter of its term")
