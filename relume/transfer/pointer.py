"""JSON Pointers to what a hand may hold: /materials/NAME/terms/K/curves/CURVE or …/params/PARAMETER."""

from __future__ import annotations

from dataclasses import dataclass

from relume.errors import ParameterError
from relume.look import Look


@dataclass(frozen=True)
class _TermPointer:
    """A member of a term of a look."""

    material: str
    term: int
    name: str

    def _written(self, group: str) -> str:
        material = self.material.replace("~", "~0").replace("/", "~1")
        return f"/materials/{material}/terms/{self.term}/{group}/{self.name}"


class CurvePointer(_TermPointer):
    """A curve of a look."""

    def __str__(self) -> str:
        return self._written("curves")


class ParameterPointer(_TermPointer):
    """A parameter of a term of a look."""

    def __str__(self) -> str:
        return self._written("params")


ROTATION = "/environment/rotation"
_KINDS: dict[str, type[CurvePointer] | type[ParameterPointer]] = {"curves": CurvePointer, "params": ParameterPointer}


def parse_pointer(pointer: str) -> CurvePointer | ParameterPointer:
    """Read a pointer.

    Raises:
        ParameterError: it points to neither a curve nor a parameter.
    """
    parts = pointer.split("/")
    if (
        len(parts) != 7
        or (parts[0], parts[1], parts[3]) != ("", "materials", "terms")
        or parts[5] not in _KINDS
        or not (parts[4].isascii() and parts[4].isdigit() and len(parts[4]) <= 4)
    ):
        raise ParameterError("pointer", pointer, "like /materials/NAME/terms/0/curves/theta_h, or …/params/ior")
    return _KINDS[parts[5]](parts[2].replace("~1", "/").replace("~0", "~"), int(parts[4]), parts[6])


def parse_curve(pointer: str) -> CurvePointer:
    """Read a pointer to a curve.

    Raises:
        ParameterError: it does not point to one.
    """
    found = parse_pointer(pointer)
    if not isinstance(found, CurvePointer):
        raise ParameterError("curve", pointer, "a pointer like /materials/NAME/terms/0/curves/theta_h")
    return found


def moved_parameter(before: Look, after: Look) -> ParameterPointer | None:
    """The one parameter by which two looks of the same materials differ: what a hand on a slider moves."""
    moved = [
        ParameterPointer(material, k, name)
        for material, part in after.materials.items()
        if part is not before.materials[material]
        for k, (old, new) in enumerate(zip(before.materials[material].terms, part.terms, strict=False))
        if old is not new and old["model"] == new["model"]
        for name, value in (new.get("params") or {}).items()
        if value != (old.get("params") or {}).get(name)
    ]
    return moved[0] if len(moved) == 1 else None
