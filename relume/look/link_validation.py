"""Validation of light and shadow links.

A link is null for all surfaces, {"include": names} or {"exclude": names}, with names = {"materials": [...],
"objects": [...]}. Looks know the materials of their scene; objects are looked up when the light is traced.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from relume.core.errors import Description
from relume.core.validation import Pointer, check_object, invalid_value, names_text

MAX_LINKED_NAMES = 10_000
_MAX_NAME = 1000  # characters
_FORM = 'null for all surfaces, {"include": ...} or {"exclude": ...} with lists of "materials" and "objects"'


def check_link(pointer: Pointer, link: Any, material_names: Collection[str]) -> None:
    """Require a link of materials of this scene, and of objects. Raises ParameterError.

    Args:
        pointer: location in the document. link: value of any type. material_names: materials of the scene.
    """
    if link is None:
        return
    if not isinstance(link, Mapping) or link.keys() not in ({"include"}, {"exclude"}):
        raise invalid_value(pointer, link, _FORM)
    ((mode, names),) = link.items()
    check_object((*pointer, mode), names, ("materials", "objects"))
    for field, values in names.items():
        _check_names((*pointer, mode, field), values)
    if missing := set(names.get("materials", ())) - set(material_names):
        description = Description(names_text(missing))
        raise invalid_value(
            (*pointer, mode, "materials"), description, f"materials of this scene: {names_text(material_names)}"
        )


def _check_names(pointer: Pointer, values: Any) -> None:
    if not isinstance(values, list | tuple) or len(values) > MAX_LINKED_NAMES:
        raise invalid_value(pointer, values, f"a list of at most {MAX_LINKED_NAMES} names")
    for index, name in enumerate(values):
        if not isinstance(name, str) or not len(name) <= _MAX_NAME:
            raise invalid_value((*pointer, index), name, f"a name of at most {_MAX_NAME} characters")
