"""Check the array shapes in annotations of `relume`, `Shaped[F32, "n 3"]`, in every call of a test.

Import it before `relume`: it checks modules that are imported later. Nothing else reads the shapes, so a wrong
annotation fails the first test that calls the function.
"""

from __future__ import annotations

import functools
import importlib.abc
import importlib.machinery
import inspect
import sys
import types
import typing
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import AbstractArray, jaxtyped

UNCHECKED = {
    "relume.scene.model.Mesh.__init__": "importers validate meshes after they made them",
    "relume.assets.btf.local_pca_btf.LocalPcaBtf.__init__": "files are read into it before their shapes are validated",
}
"""Functions whose annotations are not checked, and why."""


class ShapeError(TypeError):
    """Mismatch between the shape of an array and its annotation or other arrays of the call."""


def _matches(value: object, hint: Any) -> bool:
    """True if a value has the shapes of a hint; values other than arrays have none."""
    if isinstance(hint, type) and issubclass(hint, AbstractArray):
        return isinstance(np.asarray(value) if isinstance(value, np.generic) else value, hint)
    alternatives = typing.get_args(hint)
    if isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union:
        return value is None or any(_matches(value, alternative) for alternative in alternatives)
    if typing.get_origin(hint) is tuple and isinstance(value, tuple) and len(value) == len(alternatives):
        return all(_matches(item, alternative) for item, alternative in zip(value, alternatives, strict=True))
    return True


def with_checks(function: types.FunctionType) -> Callable[..., Any]:
    """Return the function with shape checks at each call; unchanged if its annotations have no shapes."""
    stated = {name: text for name, text in function.__annotations__.items() if "Shaped[" in str(text)}
    if not stated or f"{function.__module__}.{function.__qualname__}" in UNCHECKED:
        return function
    signature = inspect.signature(function)

    @functools.cache
    def hint(name: str) -> Any:
        return eval(stated[name], function.__globals__)

    def check(name: str, value: object) -> None:
        if name in stated and not _matches(value, hint(name)):
            shape = getattr(value, "shape", type(value).__name__)
            raise ShapeError(f"{function.__module__}.{function.__qualname__}: {name} is {shape}, not {stated[name]}")

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        result = function(*args, **kwargs)  # outside: a context belongs to one thread, and calls nest
        with jaxtyped("context"):  # a dimension has one size in all arrays of a call
            for name, value in signature.bind(*args, **kwargs).arguments.items():
                check(name, value)
            check("return", result)
        return result

    return call


def _check_module(module: types.ModuleType) -> None:
    classes = [
        value for value in vars(module).values() if inspect.isclass(value) and value.__module__ == module.__name__
    ]
    for owner in (module, *classes):
        for name, value in list(vars(owner).items()):
            if isinstance(value, types.FunctionType) and value.__module__ == module.__name__:
                setattr(owner, name, with_checks(value))


class _CheckingImporter(importlib.abc.MetaPathFinder):
    def find_spec(
        self, name: str, path: Sequence[str] | None, target: types.ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        spec = importlib.machinery.PathFinder.find_spec(name, path, target) if name.startswith("relume.") else None
        if spec is None or not isinstance(spec.loader, importlib.machinery.SourceFileLoader):
            return None
        spec.loader = _CheckingLoader(spec.loader.name, spec.loader.path)
        return spec


class _CheckingLoader(importlib.machinery.SourceFileLoader):
    def exec_module(self, module: types.ModuleType) -> None:
        super().exec_module(module)
        _check_module(module)


sys.meta_path.insert(0, _CheckingImporter())
