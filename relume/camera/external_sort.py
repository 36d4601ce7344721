"""Rows that come part by part, each part sorted, put in one order without ever being in memory together.

Parts go to files as they come, column by column. Where a key's rows of a part begin is all that is kept of them; in
order, each key's rows are those of the first part, of the second, and so on: a stable sort.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

_ROWS_PER_BLOCK = 1 << 16


@dataclass
class _Runs:
    """Rows of one part and one key, in their final order.

    Attributes:
        source_start: the first row of each, as they came. (r,) start: the same in order, and their number. (r + 1,)
    """

    source_start: NDArray[np.int64]
    start: NDArray[np.int64]


class Column:
    """One sorted column, a `relume.store.bake_protocol.RowSource`; one thread at a time reads rows on request."""

    def __init__(
        self, owner: ExternalSort, file: IO[bytes], dtype: np.dtype[Any], shape: tuple[int, ...], runs: _Runs
    ) -> None:
        self._owner, self._file, self._runs = owner, file, runs  # files are closed with their owner
        self.dtype, self.shape = dtype, shape
        self._row_bytes = int(np.prod(shape[1:], dtype=np.int64)) * dtype.itemsize

    def __getitem__(self, rows: slice) -> NDArray[Any]:
        """Some rows that follow each other."""
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
        """Read rows as they came. out: written, contiguous."""
        self._file.seek(row * self._row_bytes)
        data = self._file.read(out.nbytes)
        out.reshape(-1).view(np.uint8)[:] = np.frombuffer(data, np.uint8)

    def take(self, rows: NDArray[np.integer]) -> NDArray[Any]:
        """Rows in any order, quickly where most follow each other. (n, …)"""
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
    """Columns of rows that come in parts.

    Attributes:
        scratch: opens a file that is gone when it is closed.
    """

    scratch: Callable[[], IO[bytes]]
    num_rows: int = 0
    _files: dict[str, IO[bytes]] = field(default_factory=dict)
    _formats: dict[str, tuple[np.dtype[Any], tuple[int, ...]]] = field(default_factory=dict)
    _keys: list[NDArray[np.int32]] = field(default_factory=list)
    _run_starts: list[NDArray[np.int64]] = field(default_factory=list)

    def add(self, key: NDArray[np.int32], columns: Mapping[str, NDArray[Any]]) -> None:
        """Take a part.

        Args:
            key: of its rows, rising. (n,) columns: the same ones for all parts. (n, …)
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
        """All columns, their rows in order; no part comes after that."""
        key, source_starts = np.concatenate(self._keys), np.concatenate(self._run_starts)
        length = np.diff(source_starts, append=self.num_rows)
        order = np.argsort(key, kind="stable")
        runs = _Runs(source_starts[order], np.concatenate([[0], np.cumsum(length[order])]))
        return {
            name: Column(self, self._files[name], dtype, (self.num_rows, *shape), runs)
            for name, (dtype, shape) in self._formats.items()
        }
