"""Sun disks are extracted from maps: disks and remainder sum to the map, and wide lights stay."""

import numpy as np
import pytest

from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.lights.sun_disks import NUM_TARGET_SETS, NUM_TARGETS, remove_sun_disks


def environment_with_disks(*disks, size=(128, 256)):
    """Gray, brighter above; each disk has an axis, a radius in degrees, and a radiance."""
    towards = texel_directions(*size).astype(np.float64)
    radiance = np.repeat(1 + 0.5 * towards[..., 1:2], 3, axis=2)
    for axis, radius, light in disks:
        axis = np.asarray(axis) / np.linalg.norm(axis)
        radiance[towards @ axis > np.cos(np.radians(radius))] += light
    return radiance.astype(np.float32)


def integrated(radiance):
    """∫ L dω of a map, per channel."""
    return (radiance.astype(np.float64) * texel_solid_angles(*radiance.shape[:2])[:, None, None]).sum(axis=(0, 1))


HARD = ([0.3, 1, 0.2], 1.5, [9e3, 8e3, 6e3])
OTHER = ([-1, 0.4, 0.5], 1.5, [3e3, 4e3, 6e3])


@pytest.mark.parametrize("disks", [(HARD,), (HARD, OTHER)])
def test_disks_and_remainder_sum_to_the_map(disks):
    radiance = environment_with_disks(*disks)
    removed = remove_sun_disks(radiance)
    assert len(removed.sun_disks) == len(disks)
    np.testing.assert_allclose(
        sum(sun.irradiance for sun in removed.sun_disks) + integrated(removed.residual), integrated(radiance), rtol=1e-5
    )
    np.testing.assert_allclose(removed.residual, environment_with_disks(), atol=0.1)
    axis = np.asarray(HARD[0]) / np.linalg.norm(HARD[0])
    first = max(removed.sun_disks, key=lambda sun: sun.mean @ axis)
    assert first.mean @ axis > np.cos(np.radians(0.5)) * np.linalg.norm(first.mean)
    np.testing.assert_allclose(first.irradiance / first.irradiance[0], np.array(HARD[2]) / HARD[2][0], rtol=1e-3)


def test_targets_are_distributed_like_the_light():
    sun = remove_sun_disks(environment_with_disks(HARD)).sun_disks[0]
    assert sun.directions.shape == (NUM_TARGET_SETS, NUM_TARGETS, 3)
    np.testing.assert_allclose(np.linalg.norm(sun.directions, axis=2), 1, atol=1e-12)
    np.testing.assert_allclose(sun.directions.mean(axis=(0, 1)), sun.mean, atol=2e-3)
    np.testing.assert_allclose(sun.directions.mean(axis=1), np.tile(sun.mean, (NUM_TARGET_SETS, 1)), atol=6e-3)
    width = np.sqrt(2 * (1 - np.linalg.norm(sun.mean)))
    assert 0.8 * width < np.sqrt(2 * (1 - np.linalg.norm(sun.directions.mean(axis=(0, 1))))) < 1.4 * width


@pytest.mark.parametrize(
    "radiance",
    [
        environment_with_disks(),
        environment_with_disks(([0, 1, 0.1], 4, [2e3] * 3)),
        environment_with_disks((HARD[0], 1.5, [120.0] * 3)),
    ],
    ids=["none", "wide", "dim"],
)
def test_wide_or_dim_regions_stay_in_the_map(radiance):
    removed = remove_sun_disks(radiance)
    assert removed.sun_disks == ()
    assert removed.residual is radiance
