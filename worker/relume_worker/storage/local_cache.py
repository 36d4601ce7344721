"""Local cache of object storage in the data directory: scenes, and bakes within a size limit.

An open bake has a lock that all processes of the machine respect; others are evicted when space is needed, least
recently opened first. Files that are not in the storage are never evicted.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from relume.core.filesystem import UNFINISHED
from relume.core.folder_size import folder_bytes
from relume.store.publish import manifest_digests
from relume.store.schema import MANIFEST_NAME
from relume_worker.storage.locks import open_lock_file
from relume_worker.storage.partial_uploads import delete_partial
from relume_worker.storage.remote import ObjectStorage, get_storage

DEFAULT_CACHE_BYTES = 20 << 30

Opened = TypeVar("Opened")


def cache_bytes() -> int:
    """Size limit of cached bakes in bytes: `RELUME_STORAGE_CACHE_BYTES`."""
    try:
        return max(0, int(os.environ.get("RELUME_STORAGE_CACHE_BYTES", "")))
    except ValueError:
        return DEFAULT_CACHE_BYTES


def push(path: Path) -> None:
    """Upload a scene's folder or a published bake, if there is a storage without it. Raises StorageError."""
    storage = get_storage()
    if storage is None or storage.has(_name(path)):
        return
    if path.suffix == ".zarr":
        files = [*manifest_digests(path), MANIFEST_NAME]
    else:
        files = sorted(file.name for file in path.iterdir() if file.is_file() and not file.match(UNFINISHED))
    storage.put(_name(path), path, files)
    if path.suffix == ".zarr":
        _evict_until_fits(path.parent, storage, 0)


def fetch_if_missing(path: Path) -> Path:
    """Fetch a scene's folder or a bake's store if it is only in the storage; if it is nowhere, the path does not exist.

    Args:
        path: path in the data directory.
    Returns:
        The same path.
    Raises:
        StorageError: the storage does not answer.
    """
    storage = get_storage()
    if storage is None or path.exists():
        return path
    with _with_lock(path, "fetch", fcntl.LOCK_EX):
        if path.exists():  # another process was faster
            return path
        if path.suffix == ".zarr":
            _evict_until_fits(path.parent, storage, storage.num_bytes(_name(path)))
        unfinished = path.with_name(UNFINISHED.replace("*", path.name))
        if storage.fetch(_name(path), unfinished):
            unfinished.rename(path)
    return path


def open_cached(path: Path, open_store: Callable[[Path], Opened]) -> Opened:
    """Open a bake, fetched if it is only in the storage; it is locked while the returned object lives.

    Args:
        path: path of its store. open_store: opens it; raises if it does not exist.
    """
    if get_storage() is None:
        return open_store(path)
    lock = _lock(path, "use", fcntl.LOCK_SH)
    try:
        bake = open_store(fetch_if_missing(path))
    except BaseException:
        os.close(lock)
        raise
    weakref.finalize(bake, os.close, lock)
    return bake


def is_in_storage(path: Path) -> bool:
    """True if the storage has a scene or a bake. Raises StorageError."""
    storage = get_storage()
    return storage is not None and storage.has(_name(path))


def delete_remote(path: Path) -> None:
    """Delete a scene or a bake from the storage; the caller deletes the local files. Raises StorageError."""
    if (storage := get_storage()) is not None:
        storage.delete(_name(path))
        if path.suffix == ".zarr":
            delete_partial(path.stem)


def _evict_until_fits(bakes: Path, storage: ObjectStorage, num_bytes: int) -> None:
    """Evict bakes until so many more bytes fit."""
    stores = sorted(bakes.glob("[!.]*.zarr"), key=_last_use_s)
    sizes = {store: folder_bytes(store) for store in stores}
    excess = sum(sizes.values()) + num_bytes - cache_bytes()
    for store in stores:
        if excess <= 0:
            return
        if storage.has(_name(store)) and _evict(store):
            excess -= sizes[store]


def _evict(store: Path) -> bool:
    """Delete a store unless it is open."""
    try:
        lock = _lock(store, "use", fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    try:
        shutil.rmtree(store, ignore_errors=True)
    finally:
        os.close(lock)
    return True


def _last_use_s(store: Path) -> float:
    """Time when a store was last opened, or made."""
    lock = _lock_path(store, "use")
    return max(path.stat().st_mtime for path in (store, lock) if path.exists())


def _name(path: Path) -> str:
    return f"{path.parent.name}/{path.name}"


def _lock_path(path: Path, purpose: str) -> Path:
    return path.parent / "locks" / f"{path.stem}.{purpose}"


def _lock(path: Path, purpose: str, mode: int) -> int:
    """Lock a scene or a bake, see `open_lock_file`; a shared lock records the time of opening."""
    descriptor = open_lock_file(_lock_path(path, purpose), mode)
    try:
        if mode == fcntl.LOCK_SH:
            os.utime(descriptor)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


@contextmanager
def _with_lock(path: Path, purpose: str, mode: int) -> Iterator[None]:
    descriptor = _lock(path, purpose, mode)
    try:
        yield
    finally:
        os.close(descriptor)
