"""Validation of glTF objects from careless exporters: what can be repaired is, each repair with a warning.

Numbers beyond their limits are clamped. Other invalid properties are omitted, so that they have their default. An
object is invalid only if a required property is missing or invalid. Objects are validated when they are used: an
invalid object that nothing refers to has no effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote, unsupported

M = TypeVar("M", bound=BaseModel)
_BOUNDS = {"greater_than_equal": "ge", "less_than_equal": "le"}
_MAX_ROUNDS = 8  # an omitted property may make the object around it invalid
_MAX_WARNINGS = 20  # of one object
_HUGE = 1e30
_HAIR = 1e-3  # a clamped number that differs by less looks the same


class GltfObjects(Generic[M]):
    """The objects of one kind in a file, validated on first use."""

    def __init__(self, model: type[M], items: Sequence[Any], kind: str, warnings: list[ImporterWarning]) -> None:
        """
        Args:
            model: model of the objects. items: their JSON, unchecked. kind: names them in messages, such as "node".
            warnings: gets a sentence for each repair.
        """
        self._model, self._items, self._kind, self._warnings = model, items, kind, warnings
        self._objects: dict[int, M | SceneError] = {}

    def __len__(self) -> int:
        return len(self._items)

    def get(self, index: int, label: str = "the scene") -> M:
        """Return an object.

        Args:
            index: index in the file. label: names the object that refers to it, in the error.
        Raises:
            SceneError: it does not exist or cannot be repaired.
        """
        if index not in self._objects:
            self._objects[index] = self._read(index, label)
        item = self._objects[index]
        if isinstance(item, SceneError):
            raise item
        return item

    def replace(self, index: int, item: M) -> None:
        """Set an object that was read."""
        self._objects[index] = item

    def used(self) -> list[tuple[str, Any]]:
        """Return label and JSON of each object that was read."""
        return [(self.label(index), self._items[index]) for index in self._objects if 0 <= index < len(self._items)]

    def _read(self, index: int, label: str) -> M | SceneError:
        if not 0 <= index < len(self._items):
            number = str(index)[:20]
            return SceneError(f"{label} refers to {self._kind} {number} of {len(self._items)}; export the scene again")
        try:
            return read_object(self._model, self._items[index], self.label(index), self._warnings)
        except SceneError as problem:
            return problem

    def label(self, index: int) -> str:
        """Name an object in messages: by its name in the file, or its index."""
        item = self._items[index] if 0 <= index < len(self._items) else None
        name = item.get("name") if isinstance(item, dict) else None
        return f"{self._kind} {quote(name)}" if isinstance(name, str) and name else f"{self._kind} {str(index)[:20]}"


def read_object(model: type[M], content: Any, label: str, warnings: list[ImporterWarning]) -> M:
    """Validate an object, repaired in place if necessary.

    Args:
        model: model of the object. content: its JSON, unchecked; is changed.
        label: names it in messages. warnings: gets a sentence for each repair.
    Raises:
        SceneError: it cannot be repaired; the message has all faults.
    """
    repairs: list[ImporterWarning] = []
    omitted: dict[str, str] = {}
    for _ in range(_MAX_ROUNDS):
        try:
            result = model.model_validate(content)
        except ValidationError as problem:
            faults = problem.errors(include_url=False)
        except RecursionError:
            raise SceneError(f"{label} is nested too deeply; export the scene again") from None
        else:
            warnings.extend(repairs[:_MAX_WARNINGS])
            return result
        reasons = {_location(fault): _describe(fault) for fault in faults}
        if not all(map(_path, faults)):
            fatal = ", ".join(omitted.get(location, reason) for location, reason in reasons.items())
            raise SceneError(f"{label} is not valid glTF 2.0: {fatal[:200]}; export the scene again")
        omitted |= reasons
        for fault in faults:
            repairs.extend(_repair(content, fault, label))
    raise SceneError(f"{label} is not valid glTF 2.0; export the scene again")


def _path(fault: Any) -> tuple[str | int, ...]:
    """Keys and indices of the value to repair; empty if there is none."""
    path = tuple(step for step in fault["loc"] if step != "[key]")
    return path[:-1] if fault["type"] == "missing" else path


def _location(fault: Any) -> str:
    return "/".join(str(step)[:40] for step in fault["loc"])


def _describe(fault: Any) -> str:
    name = quote(_location(fault)) if fault["loc"] else "it"
    return f"{name} is {'missing' if fault['type'] == 'missing' else _shorten(fault['input'])}"


def _shorten(value: object) -> str:
    """A value for a message; lists and objects by their kind."""
    if isinstance(value, (dict, list)):
        return "an object" if isinstance(value, dict) else f"a list of {len(value)}"
    return quote(value) if isinstance(value, str) else f"{value:.9g}" if isinstance(value, float) else str(value)[:40]


def _repair(content: Any, fault: Any, label: str) -> list[ImporterWarning]:
    """Clamp a number in place, or delete the property that has the fault; return what to say."""
    *parents, last = _path(fault)
    bound = fault.get("ctx", {}).get(_BOUNDS.get(fault["type"], ""))
    containers = [content]
    for step in parents:
        containers.append(_item(containers[-1], step))
    if isinstance(bound, float) and isinstance(fault["input"], (int, float)) and abs(fault["input"]) < _HUGE:
        containers[-1][last] = bound
        grade = ignored if abs(fault["input"] - bound) <= _HAIR * max(abs(bound), 1) else approximated
        return [grade(f"{_describe(fault)} in {label} and was clamped to {bound:g}.")]
    while containers and not isinstance(containers[-1], dict):  # a vector with an invalid component is omitted
        containers.pop()
        last = parents.pop() if parents else last
    if not containers or containers[-1].pop(last, None) is None:
        return []
    grade = ignored if last == "name" else unsupported
    return [grade(f"Ignored {quote(str(last))} of {label}: {_describe(fault)}.")]


def _item(container: Any, step: str | int) -> Any:
    """An item of a container, or None where a repair has deleted it."""
    if isinstance(container, dict):
        return container.get(step)
    return container[step] if isinstance(container, list) and isinstance(step, int) and step < len(container) else None
