"""External merge sort: chunks of sorted rows, merged into one order without holding all rows in memory.

Each chunk's columns are appended to files. Memory holds only the start of each key's rows in each chunk. In the merged
order, the rows of each key are those of the first chunk, then of the second, and so on: a stable sort.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

_ROWS_PER_BLOCK = 1 << 16


@dataclass
class _Runs:
    """Runs of rows with one key in one chunk, in merged order.

    Attributes:
        source_start: first row of each run in the files. (r,) start: first row in merged order, and the total. (r + 1,)
    """

    source_start: NDArray[np.int64]
    start: NDArray[np.int64]


class Column:
    """One merged column, a `relume.store.bake_protocol.RowSource`; only one thread at a time may read it."""

    def __init__(
        self, owner: ExternalSort, file: IO[bytes], dtype: np.dtype[Any], shape: tuple[int, ...], runs: _Runs
    ) -> None:
        self._owner, self._file, self._runs = owner, file, runs  # the owner's finalizer closes the files
        self.dtype, self.shape = dtype, shape
        self._row_bytes = int(np.prod(shape[1:], dtype=np.int64)) * dtype.itemsize

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        """Read consecutive rows."""
        start, stop, _ = rows.indices(self.shape[0])
        out = np.empty((max(0, stop - start), *self.shape[1:]), self.dtype)
        starts, source_starts = self._runs.start, self._runs.source_start
        run = int(np.searchsorted(starts, start, side="right")) - 1
        while start < stop:
            end = min(stop, int(starts[run + 1]))
            self._read(int(source_starts[run] + start - starts[run]), out[start - stop : end - stop or None])
            start, run = end, run + 1
        return out

    def _read(self, row: int, out: NDArray[Any]) -> None:
        """Read consecutive rows in file order. out: output, contiguous."""
        self._file.seek(row * self._row_bytes)
        data = self._file.read(out.nbytes)
        out.reshape(-1).view(np.uint8)[:] = np.frombuffer(data, np.uint8)

    def take(self, rows: Shaped[NDArray[np.integer], " n"]) -> Shaped[NDArray[Any], "n ..."]:
        """Read rows in any order, quickly if most are consecutive."""
        out = np.empty((len(rows), *self.shape[1:]), self.dtype)
        order = np.argsort(rows, kind="stable")
        bounds = np.searchsorted(rows[order], np.arange(0, self.shape[0] + _ROWS_PER_BLOCK, _ROWS_PER_BLOCK))
        for block in np.flatnonzero(np.diff(bounds)):
            block_rows, first = order[bounds[block] : bounds[block + 1]], int(block) * _ROWS_PER_BLOCK
            out[block_rows] = self[first : first + _ROWS_PER_BLOCK][rows[block_rows] - first]
        return out

    def __array__(self, dtype: Any = None) -> NDArray[Any]:
        return np.asarray(self[:], dtype)


@dataclass
class ExternalSort:
    """Columns of rows that arrive in sorted chunks.

    Attributes:
        scratch: opens a temporary file that is deleted when it is closed.
    """

    scratch: Callable[[], IO[bytes]]
    num_rows: int = 0
    _files: dict[str, IO[bytes]] = field(default_factory=dict)
    _formats: dict[str, tuple[np.dtype[Any], tuple[int, ...]]] = field(default_factory=dict)
    _keys: list[NDArray[np.int32]] = field(default_factory=list)
    _run_starts: list[NDArray[np.int64]] = field(default_factory=list)

    def add(self, key: Shaped[NDArray[np.int32], " n"], columns: Mapping[str, NDArray[Any]]) -> None:
        """Append a chunk.

        Args:
            key: sort key of each row, ascending. columns: the same names for all chunks. (n, …)
        """
        first = np.flatnonzero(np.diff(key, prepend=np.int32(-1)))
        self._keys.append(key[first])
        self._run_starts.append(first + self.num_rows)
        self.num_rows += len(key)
        for name, rows in columns.items():
            if name not in self._files:
                self._files[name], self._formats[name] = self.scratch(), (rows.dtype, rows.shape[1:])
                weakref.finalize(self, self._files[name].close)
            self._files[name].write(np.ascontiguousarray(rows).data)

    def columns(self) -> dict[str, Column]:
        """Return all columns in merged order; add no chunk after this."""
        key, source_starts = np.concatenate(self._keys), np.concatenate(self._run_starts)
        length = np.diff(source_starts, append=self.num_rows)
        order = np.argsort(key, kind="stable")
        runs = _Runs(source_starts[order], np.concatenate([[0], np.cumsum(length[order])]))
        return {
            name: Column(self, self._files[name], dtype, (self.num_rows, *shape), runs)
            for name, (dtype, shape) in self._formats.items()
        }
