"""Store reader. Damage is an error with the array's name, never zeros.

Zarr fills missing chunks; here a missing shard, a truncated shard and a failed checksum all raise ChunkDamagedError.
"""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.storage import LocalStore

from relume.core.errors import ChunkDamagedError, StoreDeletedError, StoreError, StoreNotFoundError
from relume.store.bake_protocol import ArraySpec
from relume.store.disk_space import scratch_file
from relume.store.schema import (
    MANIFEST_NAME,
    check_path,
    check_version,
    num_shards,
    spec_from_metadata,
)
from relume.store.small_files import read_json

# All readers share Zarr's event loop and its thread pool; with the defaults (10 and 32) the threads of a small machine
# only wait for each other. The settings take effect when zarr first reads.
zarr.config.set({"async.concurrency": 4, "threading.max_workers": 4})


class Reader:
    """A store that is open for reading; implements `relume.store.bake_protocol.TaskStore`. Thread-safe."""

    def __init__(self, path: Path, attributes: Mapping[str, Any]) -> None:
        self.path = path
        self._attributes = attributes
        self._arrays: dict[str, tuple[ArraySpec, zarr.Array[Any]]] = {}
        self._lock = threading.Lock()

    @property
    def attributes(self) -> Mapping[str, Any]:
        """The store's root attributes."""
        return self._attributes

    def spec(self, path: str) -> ArraySpec:
        """Shape, type, chunks and shards of an array. Raises StoreError if it does not exist."""
        return self._open(path)[0]

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array. Raises StoreError if it does not exist."""
        return self.spec(path).shape

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read rows [start, stop) of an array.

        Args:
            path: path of the array inside the store. start, stop: rows; by default all.
        Raises:
            StoreDeletedError: the whole store was deleted.
            ChunkDamagedError: a shard is missing or truncated, or a checksum fails.
            StoreError: there is no such array, or the rows lie outside it.
        """
        try:
            return self._rows(path, start, stop)
        except StoreError as error:
            if not (self.path / "zarr.json").is_file():
                raise StoreDeletedError from error
            raise

    def check_canceled(self) -> None:
        """Do nothing: tasks of bakes end with their process. See `relume.store.bake_protocol.TaskStore`."""

    def scratch(self) -> IO[bytes]:
        """Open a nameless file beside the arrays. See `relume.store.bake_protocol.TaskStore`."""
        return scratch_file(self.path)

    def _rows(self, path: str, start: int, stop: int | None) -> NDArray[Any]:
        spec, array = self._open(path)
        stop = spec.shape[0] if stop is None else stop
        if not 0 <= start <= stop <= spec.shape[0]:
            raise StoreError(f"rows {start}..{stop} lie outside {path} with {spec.shape[0]} rows")
        if start == stop or 0 in spec.shape:
            return np.zeros((stop - start, *spec.shape[1:]), spec.dtype)
        self._check_shards_exist(spec, start, stop)
        try:
            return np.asarray(array[start:stop])
        except MemoryError:
            raise
        except Exception as error:  # zarr and its codecs raise many kinds on damaged bytes
            raise ChunkDamagedError(path, f"rows {start}..{stop}: {str(error)[:120]}") from error

    def _open(self, path: str) -> tuple[ArraySpec, zarr.Array[Any]]:
        with self._lock:
            if path not in self._arrays:
                try:
                    metadata = read_json(self.path / check_path(path) / "zarr.json")
                except StoreNotFoundError as error:
                    raise StoreError(f"the store has no array {path}; bake the scene again") from error
                spec = spec_from_metadata(path, metadata)
                self._arrays[path] = spec, zarr.open_array(LocalStore(self.path, read_only=True), path=path, mode="r")
            return self._arrays[path]

    def _check_shards_exist(self, spec: ArraySpec, start: int, stop: int) -> None:
        # An empty file would read as zeros; a shard ends with its index: 16 bytes per chunk and a checksum.
        index_bytes = 16 * (math.prod(spec.shards) // math.prod(spec.chunks)) + 4
        per_row = [-(-n // s) for n, s in zip(spec.shape[1:], spec.shards[1:], strict=True)]
        for row in range(start // spec.shards[0], -(-stop // spec.shards[0])):
            for index in np.ndindex(*per_row):
                shard = self.path.joinpath(spec.path, "c", str(row), *map(str, index))
                if not shard.is_file() or shard.stat().st_size < index_bytes:
                    raise ChunkDamagedError(spec.path, f"the shard of row {row * spec.shards[0]} is missing or cut")


def open_staging(path: Path) -> Reader:
    """Open a store that is still being written, without a manifest. Raises StoreNotFoundError, SchemaVersionError."""
    attributes = read_json(path / "zarr.json").get("attributes")
    if not isinstance(attributes, dict):
        raise StoreError(f"{path.name} has no attributes; bake the scene again")
    check_version(attributes)
    return Reader(path, attributes)


def read_code(path: Path) -> str | None:
    """Hash of the code that wrote a store, see `relume.core.source_hash.bake_code`; None if it is unknown."""
    try:
        code = open_staging(path).attributes.get("code")
    except StoreError:
        return None
    return code if isinstance(code, str) else None


def open_store(path: Path) -> Reader:
    """Open a published store; check its version, the sizes of all files, and that every array has all its shards.

    Checksums of the content are checked when rows are read.

    Raises:
        StoreNotFoundError: there is no published store.
        SchemaVersionError: another version of relume wrote it with another layout.
        ChunkDamagedError: a file is missing or its size has changed since it was published.
        StoreError: its metadata is unreadable or invalid.
    """
    path = Path(path)
    if not (path / MANIFEST_NAME).is_file():
        raise StoreNotFoundError(f"there is no complete store {path.name}; bake the scene first")
    reader = open_staging(path)
    sizes = _manifest_sizes(path)
    for name, size in sizes.items():
        file = path / name
        if not file.is_file() or file.stat().st_size != size:
            raise ChunkDamagedError(name, "missing or cut since it was published")
    num_present = Counter(name.partition("/c/")[0] for name in sizes if "/c/" in name)
    for name in sizes:
        if name.endswith("/zarr.json"):
            _check_array(path, name, num_present)
    return reader


def _manifest_sizes(path: Path) -> dict[str, int]:
    """Size in bytes of every file by name; rejects names outside the store."""
    try:
        sizes = {str(entry["path"]): int(entry["bytes"]) for entry in read_json(path / MANIFEST_NAME)["files"]}
    except (KeyError, TypeError, ValueError) as error:
        raise StoreError(f"the manifest of {path.name} is unreadable; bake the scene again") from error
    if any(name.startswith("/") or ".." in name.split("/") for name in sizes) or "zarr.json" not in sizes:
        raise StoreError(f"the manifest of {path.name} names files outside the store; bake the scene again")
    return sizes


def _check_array(path: Path, document: str, num_present: Mapping[str, int]) -> None:
    """Raise ChunkDamagedError if shards of an array are missing. num_present: number of shards by array path"""
    metadata = read_json(path / document)
    if metadata.get("node_type") == "group":
        return
    array_path = document.removesuffix("/zarr.json")
    spec = spec_from_metadata(check_path(array_path), metadata)
    present = num_present.get(array_path, 0)
    if present != num_shards(spec):
        raise ChunkDamagedError(array_path, f"{present} shards of {num_shards(spec)}")


def rows_per_shard(spec: ArraySpec) -> int:
    """Rows per read that touch each shard once and stay near 64 MB."""
    row_bytes = max(1, math.prod(spec.shape[1:]) * np.dtype(spec.dtype).itemsize)
    return max(spec.chunks[0], min(spec.shards[0], (64 << 20) // row_bytes // spec.chunks[0] * spec.chunks[0]))
