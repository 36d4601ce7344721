"""A library with one environment, and its file."""

import pytest
from environment_files import dusk, write_map

from relume.assets.environments.environment_store import STORE, store_environment


@pytest.fixture(scope="session")
def dusk_file(tmp_path_factory):
    return write_map(tmp_path_factory.mktemp("maps") / "dusk.exr", dusk())


@pytest.fixture(scope="session")
def library(dusk_file, tmp_path_factory):
    """A library folder with one imported environment, in use."""
    with STORE.with_search_folder(tmp_path_factory.mktemp("library") / "environments") as folder:
        store_environment(folder, dusk_file, "Dusk")
        yield folder
