"""Sources of many points: their irradiance against the sum over every point."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from tiny_scenes import make_surface_points

from relume.core.cache import Cache
from relume.lights.local_lights import LightPoints, make_light_strata, prepare_local_lights
from relume.live.opened.local_lights import LocalLights
from relume.look import LightGeometry
from relume.raytrace.local_light_visibility import compute_irradiance

SOURCE = LightGeometry("points", source="Bulbs")
NUM_RECEIVERS = 400


def num_samples() -> int:
    store = SimpleNamespace(attributes={"look": {"lights": {}}})
    return LocalLights(cast(Any, store), Cache(1 << 20), "bake").num_samples(SOURCE)


@pytest.mark.parametrize(("num_points", "max_error"), [(300, 1e-6), (1000, 1e-6), (5000, 0.02)])
def test_the_sum_is_that_of_every_point(num_points: int, max_error: float) -> None:
    """Receivers on a floor of 2 × 2 m, points 0.3 to 0.9 m above it."""
    rng = np.random.default_rng(3)
    position = rng.uniform((-0.9, 0.3, -0.9), (0.9, 0.9, 0.9), (num_points, 3)).astype(np.float32)
    intensity = rng.uniform(0.5, 1.5, num_points)
    intensity /= intensity.mean()
    down, cone = np.tile(np.float32([0, -1, 0]), (num_points, 1)), np.full((num_points, 2), 180, np.float32)
    light = prepare_local_lights(SOURCE, points=LightPoints(position, down, cone, intensity.astype(np.float32)))
    strata = make_light_strata(light, num_samples())
    floor = rng.uniform(-1, 1, (NUM_RECEIVERS, 3)) * [1, 0, 1]
    receivers = make_surface_points(floor.astype(np.float32), np.tile(np.float32([0, 1, 0]), (NUM_RECEIVERS, 1)))
    visible = np.full((NUM_RECEIVERS, -(-len(strata.uv) // 8)), 255, np.uint8)
    to_light = position[None].astype(np.float64) - floor[:, None]
    expected = (intensity * to_light[..., 1] / np.linalg.norm(to_light, axis=2) ** 3).sum(axis=1)
    actual = compute_irradiance(light, strata, receivers, visible)
    assert np.sqrt(((actual - expected) ** 2).mean() / (expected**2).mean()) < max_error
