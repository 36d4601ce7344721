"""Publish a finished store: verify every chunk, consolidate metadata, write the manifest, rename into place."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable
from pathlib import Path

import zarr
from zarr.storage import LocalStore

from relume.core.errors import StoreError
from relume.core.filesystem import UNFINISHED, atomic_write, remove_folder
from relume.store.reader import Reader, open_staging, rows_per_shard
from relume.store.schema import MANIFEST_NAME, SCHEMA_VERSION
from relume.store.small_files import read_json


def publish(staging: Path, target: Path, check: Callable[[], object] = lambda: None) -> int:
    """Publish a staging store atomically.

    Every chunk is read back first. Leftovers of interrupted writes are removed, so that the same bake gives the same
    files, byte for byte, however often it was interrupted.

    Args:
        staging: the finished store, on the same file system as `target`.
        target: the path for readers; an older store there is replaced.
        check: called after long steps; raises if the store must not be published any more.
    Returns:
        Size of the store in bytes.
    Raises:
        ChunkDamagedError: a chunk is missing or damaged.
    """
    for leftover in [*staging.rglob("*.partial"), *staging.glob(UNFINISHED), staging / MANIFEST_NAME]:
        leftover.unlink(missing_ok=True)
    reader = open_staging(staging)
    for path in array_paths(staging):
        _verify(reader, path)
    check()
    with warnings.catch_warnings():
        # Zarr warns that consolidated metadata is an extension; readers without it fall back.
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(LocalStore(staging))
    num_bytes = _write_manifest(staging)
    check()
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.exists():
        remove_folder(target)
    staging.rename(target)
    return num_bytes


def array_paths(path: Path) -> list[str]:
    """Paths of all arrays of a store, sorted."""
    documents = sorted(path.rglob("zarr.json"))
    return [str(d.parent.relative_to(path)) for d in documents if read_json(d).get("node_type") == "array"]


def _verify(reader: Reader, path: str) -> None:
    spec = reader.spec(path)
    step = rows_per_shard(spec)
    for start in range(0, spec.shape[0], step):
        reader.read(path, start, min(start + step, spec.shape[0]))


def _write_manifest(staging: Path) -> int:
    files = []
    for file in sorted(file for file in staging.rglob("*") if file.is_file()):
        with file.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        files.append({"path": file.relative_to(staging).as_posix(), "bytes": file.stat().st_size, "sha256": digest})
    text = json.dumps({"schema_version": SCHEMA_VERSION, "files": files}, indent=1)
    with atomic_write(staging / MANIFEST_NAME) as unfinished:
        unfinished.write_text(text)
    return sum(int(str(entry["bytes"])) for entry in files) + len(text)


def manifest_digests(path: Path) -> dict[str, str]:
    """SHA-256 of every file of a published store except the manifest.

    Raises:
        StoreNotFoundError: there is no published store. StoreError: its manifest is unreadable.
    """
    try:
        return {str(entry["path"]): str(entry["sha256"]) for entry in read_json(path / MANIFEST_NAME)["files"]}
    except (KeyError, TypeError) as error:
        raise StoreError(f"the manifest of {path.name} is unreadable; bake the scene again") from error
