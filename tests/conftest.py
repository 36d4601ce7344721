"""What all tests share: where real files lie, and helper modules beside this file."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real scenes and environments; tests that need it skip where there is none."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("RELUME_SHARED_DATA", beside))
    if not folder.is_dir():
        pytest.skip("there is no folder of shared data; RELUME_SHARED_DATA names it")
    return folder
