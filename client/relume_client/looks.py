"""Looks as objects: materials, terms, parameters and lights by name, with completion.

A look is the JSON document of docs/formats.md. `Look` reads and writes it by attributes and items.
"""

from __future__ import annotations

import difflib
import json
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, cast

import numpy as np

from relume_client.bodies import LookDocument, MaterialLook, TermLook

Path = tuple[str | int, ...]
Change = tuple[Path, Any]
"""A path in a look, and the JSON value that it has from now on."""
_GROUPS = "materials", "lights"
_SECTIONS = "environment", "background", "transport", "display"


def to_json(value: Any) -> Any:
    """A value as JSON has it: arrays as lists, NumPy's numbers as Python's, parts of looks as documents.

    Raises:
        ValueError: a number is not finite. TypeError: JSON has no such values.
    """
    return json.loads(json.dumps(value, default=_plain, allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, LookPart):
        return value.document
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{value!r} cannot be part of a look: give numbers, texts, lists or mappings")


def pointer(path: Path) -> str:
    """A JSON Pointer."""
    return "".join("/" + str(step).replace("~", "~0").replace("/", "~1") for step in path)


def with_value(document: Any, path: Path, value: Any) -> Any:
    """A copy of a document with another value at a path; all else is shared."""
    if not path:
        return value
    step, rest = path[0], path[1:]
    if isinstance(document, list):
        return [with_value(item, rest, value) if index == step else item for index, item in enumerate(document)]
    return {**document, step: with_value(document.get(step, {}), rest, value)}


def with_changes(document: Any, changes: Iterable[Change]) -> Any:
    """A copy of a document with all changes, in order."""
    for path, value in changes:
        document = with_value(document, path, value)
    return document


class LookPart:
    """A part of a look. Its fields are attributes and items; values that are objects are parts themselves."""

    __slots__ = ("_path", "_root")
    _optional: ClassVar[Iterable[str]] = ()
    """Fields that a document need not have."""
    _path: Path
    _root: Look

    def __init__(self, root: Look, path: Path) -> None:
        object.__setattr__(self, "_root", root)
        object.__setattr__(self, "_path", path)

    @property
    def document(self) -> Any:
        """The JSON of this part, not to be changed; None for an optional field that is not set."""
        value: Any = self._root._document
        for step in self._path:
            value = value.get(step) if isinstance(value, dict) else value[step]
        return value

    def _paths(self) -> dict[str, Path]:
        """Names of this part's fields, with their paths."""
        document = self.document
        names = (*self._optional, *document) if isinstance(document, dict) else ()
        return {name: (*self._path, name) for name in names}

    def _find(self, name: str | int) -> Path:
        if isinstance(name, int):
            return (*self._path, range(len(self.document))[name])
        paths = self._paths()
        if name not in paths:
            label = pointer(self._path) or "the look"
            near = difflib.get_close_matches(name, paths, 1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise KeyError(f"{label} has no {name!r}; {hint}It has: {', '.join(paths) or 'nothing'}")
        return paths[name]

    def __getitem__(self, name: str | int) -> Any:
        return self._root._value(self._find(name))

    def __setitem__(self, name: str | int, value: Any) -> None:
        self._root._set([(self._find(name), to_json(value))])

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __setattr__(self, name: str, value: Any) -> None:
        try:
            self[name] = value
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), *(name for name in self._paths() if name.isidentifier())})

    def _ipython_key_completions_(self) -> list[str]:
        return list(self._paths())

    def __iter__(self) -> Iterator[Any]:
        document = self.document
        return iter(document) if isinstance(document, dict) else (self[i] for i in range(len(document)))

    def __len__(self) -> int:
        return len(self.document)

    def __contains__(self, name: object) -> bool:
        return name in self._paths()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {pointer(self._path) or '/'}: {', '.join(self._paths())}>"


class TermPart(LookPart):
    """A term of a material: its fields and its parameters."""

    __slots__ = ()
    _optional = tuple(TermLook.__annotations__)

    def _paths(self) -> dict[str, Path]:
        params = {name: (*self._path, "params", name) for name in self.document.get("params", {})}
        return {**params, **super()._paths()}


class MaterialPart(LookPart):
    """A material: its fields, its terms by model, and what exactly one of its terms has, such as `roughness`."""

    __slots__ = ()
    _optional = tuple(MaterialLook.__annotations__)

    def _paths(self) -> dict[str, Path]:
        terms = [TermPart(self._root, (*self._path, "terms", i)) for i in range(len(self.document["terms"]))]
        fields = [(name, path) for term in terms for name, path in term._paths().items()]
        fields += [(term.document["model"], term._path) for term in terms]
        count = Counter(name for name, _ in fields)
        return {**{name: path for name, path in fields if count[name] == 1}, **super()._paths()}

    def _find(self, name: str | int) -> Path:
        try:
            return super()._find(name)
        except KeyError:
            models = [term["model"] for term in self.document["terms"]]
            if any(name in TermPart(self._root, (*self._path, "terms", i)) for i in range(len(models))):
                raise KeyError(
                    f"several terms of {self._path[-1]!r} have {name!r}; say which by the model "
                    f"({', '.join(models)}) or by terms[0] to terms[{len(models) - 1}]"
                ) from None
            raise


class Look(LookPart):
    """A look: materials, lights and `light_groups` by name, `environment`, `background`, `transport` and `display`.

        look["Teapot"].roughness = 0.3
        look["Teapot"].lambert.color = 0.8, 0.2, 0.1
        look.environment.rotation = 90

    A name that both a material and a light have is one of `look.materials` or `look.lights`.

    Args:
        document: a complete look.
        on_change: called after each edit, with its changes.
    """

    __slots__ = ("_document", "_lock", "_on_change")
    _document: Any
    _lock: threading.Lock
    _on_change: Callable[[Sequence[Change]], None] | None

    def __init__(
        self, document: LookDocument | Mapping[str, Any], on_change: Callable[[Sequence[Change]], None] | None = None
    ) -> None:
        super().__init__(self, ())
        object.__setattr__(self, "_document", to_json(document))
        object.__setattr__(self, "_on_change", on_change)
        object.__setattr__(self, "_lock", threading.Lock())

    def copy(self) -> Look:
        """A look of its own with the same values, to be edited without a session."""
        return Look(self._document)

    def update(self, changes: LookDocument | Mapping[str, Any] | Look) -> None:
        """Set the given parts of a partial or complete look as one edit.

        Lists and values are replaced whole.

        Raises:
            ValueError: it is a light mix, which `Bake.with_light_mix` makes a look of.
        """
        document = to_json(changes)
        if "format" in document:
            raise ValueError("this is a light mix; give look.update(bake.with_light_mix(look, mix))")
        self._set(tuple(_differences(document, self._document, ())))

    def to_document(self) -> LookDocument:
        """A copy of the JSON document."""
        return cast(LookDocument, json.loads(json.dumps(self._document)))

    def _paths(self) -> dict[str, Path]:
        fields = super()._paths()
        names = [(name, (group, name)) for group in _GROUPS for name in self._document.get(group, {})]
        count = Counter(name for name, _ in names)
        return {**{name: path for name, path in names if count[name] == 1}, **fields}

    def _value(self, path: Path) -> Any:
        child = LookPart(self, path)
        value = child.document
        if len(path) == 2 and path[0] == "materials":
            return MaterialPart(self, path)
        if len(path) == 4 and path[0] == "materials" and path[2] == "terms":
            return TermPart(self, path)
        is_color = isinstance(value, list) and all(isinstance(item, int | float) for item in value)
        return child if isinstance(value, dict | list) and not is_color else tuple(value) if is_color else value

    def _set(self, changes: Sequence[Change]) -> None:
        """Make changes, and report them."""
        with self._lock:
            object.__setattr__(self, "_document", with_changes(self._document, changes))
        if self._on_change is not None and changes:
            self._on_change(changes)

    def _reset(self, document: Any) -> None:
        """Set the document without reporting it."""
        with self._lock:
            object.__setattr__(self, "_document", document)


def _differences(changes: Any, document: Any, path: Path) -> Iterator[Change]:
    """Paths and values that differ: objects that both have are compared field by field."""
    for name, value in changes.items():
        old = document.get(name) if isinstance(document, dict) else None
        if isinstance(value, dict) and isinstance(old, dict):
            yield from _differences(value, old, (*path, name))
        elif old != value or name not in document:
            yield (*path, name), value
