"""Layout of a store: a Zarr v3 group whose arrays are sharded, compressed with Zstandard and checksummed (CRC-32C).

    zarr.json            root group; attributes describe the bake; consolidated metadata of everything below
    <array>/zarr.json    shape, type, chunk (unit of reading) and shard (unit of writing)
    <array>/c/…          one file per shard; every shard exists, even if all values are zero
    manifest.json        every other file with its size and SHA-256; written last, so its presence means "complete"

Limits are checked on writing and on reading, so that false metadata of a store cannot allocate large memory.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from relume.core.errors import SchemaVersionError, StoreError
from relume.store.bake_protocol import ArraySpec

SCHEMA_VERSION = 8
MANIFEST_NAME = "manifest.json"
DTYPES = frozenset(
    {"bool", "uint8", "uint16", "uint32", "uint64", "int8", "int16", "int32", "int64", "float16", "float32", "float64"}
)

MAX_JSON_BYTES = 64 << 20
MAX_CHUNK_BYTES = 256 << 20
MAX_SHARD_BYTES = 4 << 30
MAX_CHUNKS_PER_SHARD = 1 << 16
MAX_ARRAY_BYTES = 1 << 40
MAX_DIMENSIONS = 5

# Arrays that a task creates itself are read as a whole or in long runs: chunks of about this size suit both.
UNANNOUNCED_CHUNK_BYTES = 512 << 10
UNANNOUNCED_CHUNKS_PER_SHARD = 32  # a shard is in memory during writing, uncompressed and compressed

# Zarr runs any codec that the metadata names, with its configuration; a store may come from an untrusted source.
CODECS = ("bytes", "zstd", "crc32c")
INDEX_CODECS = ("bytes", "crc32c")

_SEGMENT = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")


def check_path(path: str) -> str:
    """Return an array's path inside the store, or raise StoreError if it is not a safe file name."""
    segments = path.split("/")
    if not all(_SEGMENT.fullmatch(segment) for segment in segments) or {"c", "zarr.json"} & set(segments):
        raise StoreError(f"array path {path[:80]!r} is not allowed; use letters, digits, '_', '-' and '.' between '/'")
    return path


def check_spec(spec: ArraySpec) -> ArraySpec:
    """Return `spec`, or raise StoreError if its sizes or type are not allowed in a store."""
    check_path(spec.path)
    if spec.dtype not in DTYPES:
        raise StoreError(f"array {spec.path} has type {str(spec.dtype)[:40]!r}; a store holds numbers only")
    sizes = (spec.shape, spec.chunks, spec.shards)
    if not 1 <= len(spec.shape) <= MAX_DIMENSIONS or len({len(size) for size in sizes}) != 1:
        raise StoreError(f"array {spec.path}: shape, chunks and shards need the same 1 to {MAX_DIMENSIONS} dimensions")
    if not all(type(n) is int and n >= 0 for n in spec.shape):
        raise StoreError(f"array {spec.path} has an invalid shape {str(spec.shape)[:80]}")
    if not all(type(c) is int and c > 0 and s % c == 0 for c, s in zip(spec.chunks, spec.shards, strict=True)):
        sizes_text = f"{str(spec.shards)[:80]} of {str(spec.chunks)[:80]}"
        raise StoreError(f"array {spec.path}: shards are not multiples of chunks: {sizes_text}")
    _check_bytes(spec)
    return spec


def _check_bytes(spec: ArraySpec) -> None:
    item = 8 if spec.dtype.endswith("64") else 4
    chunk, shard, whole = (math.prod(size) * item for size in (spec.chunks, spec.shards, spec.shape))
    if chunk > MAX_CHUNK_BYTES or shard > MAX_SHARD_BYTES or whole > MAX_ARRAY_BYTES:
        raise StoreError(f"array {spec.path} claims {whole} bytes in shards of {shard}; more than a store may hold")
    if math.prod(spec.shards) // math.prod(spec.chunks) > MAX_CHUNKS_PER_SHARD:
        raise StoreError(f"array {spec.path} claims more than {MAX_CHUNKS_PER_SHARD} chunks in a shard")


def spec_from_metadata(path: str, metadata: Mapping[str, Any]) -> ArraySpec:
    """Read and check shape, type, chunks and shards from an array's `zarr.json`; raises StoreError."""
    try:
        shards = metadata["chunk_grid"]["configuration"]["chunk_shape"]
        (codec,) = metadata["codecs"]
        if codec["name"] != "sharding_indexed":
            raise StoreError(f"array {path} is not sharded; bake the scene again")
        inner, index = (_names(codec["configuration"][key]) for key in ("codecs", "index_codecs"))
        spec = ArraySpec(
            path,
            tuple(metadata["shape"]),
            str(metadata["data_type"]),
            tuple(codec["configuration"]["chunk_shape"]),
            tuple(shards),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise StoreError(f"array {path} has unreadable metadata ({error}); bake the scene again") from error
    if (inner, index) != (CODECS, INDEX_CODECS) or metadata.get("storage_transformers"):
        raise StoreError(f"array {path} uses other codecs than relume's; bake the scene again")
    return check_spec(spec)


def _names(codecs: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    return tuple(str(codec["name"]) for codec in codecs)


def num_shards(spec: ArraySpec) -> int:
    """Number of shard files of a complete array."""
    return math.prod(-(-n // s) for n, s in zip(spec.shape, spec.shards, strict=True))


def check_version(attributes: Mapping[str, Any]) -> None:
    """Raise SchemaVersionError if this version of relume does not read the store's layout."""
    stored = attributes.get("schema_version")
    if stored != SCHEMA_VERSION:
        raise SchemaVersionError(stored if isinstance(stored, int) else 0, SCHEMA_VERSION)


def default_layout(path: str, shape: tuple[int, ...], dtype: str, item_bytes: int) -> ArraySpec:
    """Layout of an array that its task writes as a whole: chunks of about half a megabyte, shards of some chunks.

    Args:
        path: path of the array inside the store. shape: shape with at least one dimension.
        dtype: NumPy name of its type. item_bytes: size of one element.
    Raises:
        StoreError: the array has no dimensions.
    """
    if not shape:
        raise StoreError(f"array {path} has no dimensions; a store holds rows")
    row_bytes = max(1, math.prod(shape[1:]) * item_bytes)
    rows = 1 << max(0, (UNANNOUNCED_CHUNK_BYTES // row_bytes).bit_length() - 1)
    rows = max(1, min(rows, shape[0]))
    trailing_shape = tuple(max(1, n) for n in shape[1:])
    shard_rows = min(max(1, -(-shape[0] // rows)), UNANNOUNCED_CHUNKS_PER_SHARD) * rows
    return check_spec(ArraySpec(path, shape, dtype, (rows, *trailing_shape), (shard_rows, *trailing_shape)))
