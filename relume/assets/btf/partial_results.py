"""Partial results of a compression on disk: one file for each view, so that an interrupted one can resume.

<folder>/recipe.json    description of the compression; files of a different one are deleted
         <name>.npz     arrays of a result
"""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.filesystem import atomic_write

_FORMAT = 3
Arrays = Mapping[str, NDArray[Any]]


def as_arrays(result: NamedTuple) -> Arrays:
    """Fields of a result as arrays, by name."""
    return {name: np.asarray(value) for name, value in result._asdict().items()}


class PartialCompression:
    """Partial results of a compression, by name.

    Args:
        folder: folder of the files; created if missing. recipe: JSON description of the compression.
    """

    def __init__(self, folder: Path, recipe: Mapping[str, Any]) -> None:
        self._folder = folder
        text, path = json.dumps({"format": _FORMAT, **recipe}, sort_keys=True), folder / "recipe.json"
        if path.exists() and path.read_text() == text:
            return
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        with atomic_write(path) as unfinished:
            unfinished.write_text(text)

    def load(self, name: str) -> Arrays | None:
        """Load the arrays of a result; None if missing or damaged."""
        try:
            with (self._folder / f"{name}.npz").open("rb") as file, np.load(file, allow_pickle=False) as archive:
                return {key: archive[key] for key in archive.files}
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None

    def save(self, name: str, arrays: Arrays) -> None:
        """Save a result."""
        with atomic_write(self._folder / f"{name}.npz") as unfinished, unfinished.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)

    def load_or_compute(self, name: str, compute: Callable[[], Arrays]) -> Arrays:
        """Load a result, or compute and save it."""
        arrays = self.load(name)
        if arrays is None:
            arrays = compute()
            self.save(name, arrays)
        return arrays
