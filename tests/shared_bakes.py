"""Fixtures: tiny bakes, made once per test process."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest
from session_edits import bake_corner_scene
from tiny_scenes import make_camera, make_tiny_scene, quad, still_life

from relume.core.cache import Cache
from relume.live.opened import free_camera_error
from relume.live.opened.openers import open_transfer
from relume.methods.registry import METHODS
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process


@pytest.fixture(scope="module", autouse=True)
def unmeasured():
    """Free-camera bakes skip the measurement of their error, a third of their time."""
    with patch.object(free_camera_error, "measure_error", return_value=np.full((2, 2), np.nan, np.float32)):
        yield


@pytest.fixture(scope="session")
def baked(tmp_path_factory):
    """The still life in two views of 64×48 under 100 lights."""
    recipe = Recipe("direct", ("front", "left"), (64, 48), 100)
    return bake_in_process(METHODS["direct"], still_life(), recipe, tmp_path_factory.mktemp("bake") / "store.zarr")


@pytest.fixture(scope="session")
def transfer(baked):
    """The bake, opened."""
    return open_transfer(baked, Cache(1 << 30))


@pytest.fixture(scope="session")
def corner():
    """A white floor between a red wall and a glossy wall that reflect light onto it."""
    glossy = {"model": "blinn_phong", "color": [0.12, 0.12, 0.12], "texture": None, "params": {"exponent": 30.0}}
    materials = [
        Material("Floor", ({"model": "lambert", "color": [0.7, 0.7, 0.7]}, glossy)),
        Material("Red", ({"model": "lambert", "color": [0.8, 0.1, 0.1]},)),
        Material("Blue", ({"model": "oren_nayar", "color": [0.1, 0.2, 0.8], "params": {}},)),
    ]
    floor = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    red = quad("red", [[-1, 0, 1], [-1, 0, -1], [-1, 1.5, -1], [-1, 1.5, 1]], 1, tangent=(0, 1, 0))
    blue = quad("blue", [[-1, 0, -1], [1, 0, -1], [1, 1.5, -1], [-1, 1.5, -1]], 2)
    environment_radiance = np.full((16, 32, 3), 0.3, np.float32)
    environment_radiance[2:5, 16:20] = 30
    camera = make_camera("front", (1.2, 1.6, 2.2), (-0.2, 0.4, -0.3), 0.7)
    return make_tiny_scene(floor, red, blue, camera=camera, environment=environment_radiance, materials=materials)


@pytest.fixture(scope="session")
def gathered(corner, tmp_path_factory):
    """The bake of the corner with indirect light, opened."""
    return bake_corner_scene(corner, "gather", tmp_path_factory.mktemp("corner"))
