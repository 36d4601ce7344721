"""Arrays that some stores lack: those of earlier versions, of other methods, or of scenes without such data."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from relume.core.errors import ChunkDamagedError, StoreDeletedError, StoreError
from relume.store.bake_protocol import StoreReader


def read_optional(store: StoreReader, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any] | None:
    """Read rows [start, stop) of an array; None if the store lacks it.

    Args:
        store: an open store. path: path of the array inside the store. start, stop: rows; by default all.
    Raises:
        ChunkDamagedError, StoreDeletedError: as by `Reader.read`.
    """
    try:
        return store.read(path, start, stop)
    except (ChunkDamagedError, StoreDeletedError):
        raise
    except StoreError:
        return None


def has_array(store: StoreReader, path: str) -> bool:
    """Tell if a store has an array. Raises as `read_optional`."""
    return read_optional(store, path, stop=0) is not None
