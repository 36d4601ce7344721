"""One tiny bake for all tests of live pictures."""

from __future__ import annotations

import pytest
from tiny_scenes import still_life

from relume.store import bake_here
from relume.transfer.base import Recipe
from relume.transfer.opened import open_transfer
from relume.transfer.registry import METHODS


@pytest.fixture(scope="session")
def baked(tmp_path_factory):
    """The still life in two views of 64×48 under 150 lights."""
    recipe = Recipe("direct", ("front", "left"), (64, 48), 150)
    return bake_here(METHODS["direct"], still_life(), recipe, tmp_path_factory.mktemp("bake") / "store.zarr")


@pytest.fixture(scope="session")
def transfer(baked):
    """The bake, opened."""
    return open_transfer(baked)
