"""JSON Pointers to curves: /materials/NAME/terms/K/curves/CURVE."""

from __future__ import annotations

from dataclasses import dataclass

from relume.errors import ParameterError


@dataclass(frozen=True)
class CurvePointer:
    """A curve of a look."""

    material: str
    term: int
    curve: str

    def __str__(self) -> str:
        name = self.material.replace("~", "~0").replace("/", "~1")
        return f"/materials/{name}/terms/{self.term}/curves/{self.curve}"


def parse_pointer(pointer: str) -> CurvePointer:
    """Read a pointer.

    Raises:
        ParameterError: it does not point to a curve.
    """
    parts = pointer.split("/")
    if (
        len(parts) != 7
        or (parts[0], parts[1], parts[3], parts[5]) != ("", "materials", "terms", "curves")
        or not (parts[4].isascii() and parts[4].isdigit() and len(parts[4]) <= 4)
    ):
        raise ParameterError("curve", pointer, "a pointer like /materials/NAME/terms/0/curves/theta_h")
    return CurvePointer(parts[2].replace("~1", "/").replace("~0", "~"), int(parts[4]), parts[6])
