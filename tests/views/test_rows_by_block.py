"""Some rows of a stored array, read a block at a time; and the chunks of arrays of rows."""

from __future__ import annotations

import numpy as np
import pytest

from relume.methods.store_layout import SHARD_ROWS, array_of_rows
from relume.views.store_io import read_rows_by_block


class Store:
    """An array of squares that records how many of its rows are read at once."""

    def __init__(self, num_rows):
        self.values, self.reads = np.arange(num_rows)[:, None] ** 2, []

    def shape(self, path):
        return self.values.shape

    def read(self, path, start=0, stop=None):
        self.reads.append(len(self.values[start:stop]))
        return self.values[start:stop]


@pytest.mark.parametrize("rows", [[], [0], [9, 10, 11, 29], [3, 24, 28], list(range(30))])
def test_rows_are_those_of_the_whole_array(monkeypatch, rows):
    monkeypatch.setattr("relume.views.store_io._ROWS_PER_BLOCK", 10)
    store = Store(30)
    np.testing.assert_array_equal(read_rows_by_block(store, "a", np.array(rows, np.intp)), store.values[rows])
    assert max(store.reads) <= 10
    assert sum(store.reads) == 10 * len({row // 10 for row in rows})


@pytest.mark.parametrize(
    ("row_bytes", "chunk_rows"), [(1, SHARD_ROWS), (125, 8192), (500, 2048), (1220, 1024), (8000, 1024)]
)
def test_chunks_hold_about_a_mebibyte(row_bytes, chunk_rows):
    spec = array_of_rows("a", (100_000, row_bytes), "uint8")
    assert spec.chunks == (chunk_rows, row_bytes)
    assert spec.shards == (SHARD_ROWS, row_bytes)
    assert array_of_rows("a", (100_000,), "uint32", 4096).chunks == (4096,)
