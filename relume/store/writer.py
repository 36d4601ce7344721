"""Store writer: creates arrays from specifications, and writes rows in whole shards.

Several processes write one store at the same time, each its own shards. A shard appears by rename, so a killed process
leaves either no shard or a whole one. The worker's database records finished tasks; files are never used for that.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import Crc32cCodec, ZstdCodec
from zarr.errors import ContainsGroupError
from zarr.storage import LocalStore

from relume.core.errors import StoreError
from relume.store.bake_protocol import ArraySpec, RowSource
from relume.store.disk_space import check_disk_space
from relume.store.schema import SCHEMA_VERSION, check_spec, default_layout, spec_from_metadata
from relume.store.small_files import read_json

# Level 1 is as fast as tracing on one thread; higher levels save little on visibility bits.
ZSTD_LEVEL = 1


def create_store(path: Path, attributes: Mapping[str, Any]) -> StoreWriter:
    """Create an empty store, or open the existing unfinished one for writing.

    Args:
        path: folder of the store; made if missing.
        attributes: JSON; metadata that readers need to interpret the arrays.
    """
    document = json.loads(json.dumps({**attributes, "schema_version": SCHEMA_VERSION}, sort_keys=True))
    path.mkdir(parents=True, exist_ok=True)
    if not (path / "zarr.json").exists():
        zarr.create_group(LocalStore(path), attributes=document)
    return StoreWriter(path)


class StoreWriter:
    """An unfinished store, open for writing."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._root = zarr.open_group(LocalStore(path), mode="r+", use_consolidated=False)

    def create_array(self, spec: ArraySpec) -> None:
        """Create an array; an existing one with the same layout keeps its shards, any other is replaced."""
        check_spec(spec)
        if self._spec(spec.path) == spec:
            return
        parent, _, _ = spec.path.rpartition("/")
        if parent:
            self._require_group(parent)
        self._root.create_array(
            spec.path,
            shape=spec.shape,
            dtype=spec.dtype,
            chunks=spec.chunks,
            shards=spec.shards,
            compressors=(ZstdCodec(level=ZSTD_LEVEL), Crc32cCodec()),
            filters=None,
            fill_value=0,
            overwrite=True,
            config={"write_empty_chunks": True},
        )

    def _require_group(self, path: str) -> None:
        """Create a group unless it exists; another process may create it at the same time."""
        try:
            self._root.require_group(path)
        except ContainsGroupError:
            self._root.require_group(path)

    def write(self, path: str, rows: NDArray[Any], start: int = 0) -> None:
        """Write rows [start, start + len(rows)) of an array: whole shards, or up to the array's end.

        Args:
            path: path of the array, which must exist.
            rows: rows with the array's type and shape except for their number.
            start: index of the first row.
        Raises:
            StoreError: there is no such array, or the rows do not fit it or split a shard.
            DiskFullError: the disk is almost full, so the bake must stop.
        """
        spec = self._spec(path)
        if spec is None:
            raise StoreError(f"array {path} was not created; create it first, or write it whole with write_whole")
        stop = start + rows.shape[0]
        fits = rows.shape[1:] == spec.shape[1:] and rows.dtype == np.dtype(spec.dtype)
        if not fits or not 0 <= start <= stop <= spec.shape[0]:
            given, expected = f"{rows.dtype}{rows.shape}", f"{spec.dtype}{spec.shape}"
            raise StoreError(f"rows {start}..{stop} {given} do not fit {path} {expected}")
        if start % spec.shards[0] or (stop % spec.shards[0] and stop != spec.shape[0]):
            raise StoreError(f"rows {start}..{stop} of {path} split a shard of {spec.shards[0]} rows; write whole ones")
        if rows.size:
            check_disk_space(self.path)
            array = cast("zarr.Array[Any]", self._root[path]).with_config({"write_empty_chunks": True})
            array[start:stop] = rows

    def write_whole(self, path: str, values: RowSource) -> None:
        """Create an array with the shape of `values`, and write it shard by shard."""
        spec = default_layout(path, values.shape, values.dtype.name, values.dtype.itemsize)
        self.create_array(spec)
        for start in range(0, spec.shape[0], spec.shards[0]):
            self.write(path, values[start : start + spec.shards[0]], start)

    def _spec(self, path: str) -> ArraySpec | None:
        document = self.path / path / "zarr.json"
        if not document.exists():
            return None
        metadata = read_json(document)
        return spec_from_metadata(path, metadata) if metadata.get("node_type") == "array" else None
