"""What all tests share: where real files lie, helper modules beside this file, and which tests stay in one process."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

TOGETHER = ("e2e",)  # folders whose tests share what is dear to start: a server, its bake, a browser


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Where tests are shared out to processes, those of a file, or of a folder in `TOGETHER`, go to the same one.

    Such folders begin, as they take longest.
    """
    for item in items:
        folder = item.path.parent.name
        item.add_marker(pytest.mark.xdist_group(folder if folder in TOGETHER else item.path.stem))
    items.sort(key=lambda item: item.path.parent.name not in TOGETHER)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real scenes and environments; tests that need it skip where there is none."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("RELUME_SHARED_DATA", beside))
    if not folder.is_dir():
        pytest.skip("there is no folder of shared data; RELUME_SHARED_DATA names it")
    return folder
