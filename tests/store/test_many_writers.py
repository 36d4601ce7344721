"""Concurrent writers of one store: threads represent processes, each with its own writer."""

import threading
from pathlib import Path

import numpy as np

from relume.store.publish import publish
from relume.store.reader import open_store
from relume.store.writer import StoreWriter, create_store

NUM_WRITERS, NUM_GROUPS = 8, 12


def test_concurrent_creation_of_a_group_succeeds(tmp_path: Path) -> None:
    create_store(tmp_path / "staging", {})
    errors: list[BaseException] = []
    together = threading.Barrier(NUM_WRITERS)

    def write(number: int) -> None:
        try:
            writer = StoreWriter(tmp_path / "staging")
            for group in range(NUM_GROUPS):
                together.wait()
                writer.write_whole(f"views/{group}/{number}", np.full(4, number))
        except BaseException as error:
            errors.append(error)
            together.abort()

    threads = [threading.Thread(target=write, args=(number,)) for number in range(NUM_WRITERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    publish(tmp_path / "staging", tmp_path / "store.zarr")
    store = open_store(tmp_path / "store.zarr")
    for group in range(NUM_GROUPS):
        for number in range(NUM_WRITERS):
            np.testing.assert_array_equal(store.read(f"views/{group}/{number}"), np.full(4, number))
