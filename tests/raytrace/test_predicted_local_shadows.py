"""Predicted shadows between few traced points, against the rule in NumPy on fully traced rays."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import make_surface_points, still_life

from relume.camera.view_samples import BACKGROUND, sample_view
from relume.lights.local_lights import make_light_strata, prepare_local_lights
from relume.look import LightGeometry
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.local_light_visibility import compute_irradiance, trace_light_visibility
from relume.raytrace.moving_light import BLOCK, trace_moving_light
from relume.raytrace.scene_buffers import build_scene_buffers

FAR = EmbreeScene.build(np.array([[90, 0, 0], [91, 0, 0], [91, 1, 0]], np.float32), np.array([[0, 1, 2]], np.uint32))
CORNERS = np.array([0, 5, 10, 15])
PROBES = np.isin(np.arange(BLOCK) % 16, CORNERS)


@pytest.fixture(scope="module")
def surfaces():
    scene = still_life()
    geometry = build_scene_buffers(scene)
    samples = sample_view(scene, geometry, "front", (64, 48))
    solid = np.flatnonzero(samples.material != BACKGROUND)
    solid = solid[: len(solid) // BLOCK * BLOCK - 5]  # the last block is not full
    return geometry, samples.surface.points.position[solid], samples.surface.points.normal[solid]


def predicted(visible, is_traced):
    """True for each ray of a point that reaches the light. visible, is_traced: (n, samples), of all traced rays"""
    result = visible.copy()
    for first in range(0, len(visible), BLOCK):
        block = slice(first, first + BLOCK)
        of_probes = visible[block][PROBES[: len(visible[block])]][is_traced[block][PROBES[: len(visible[block])]]]
        if len(of_probes) and of_probes.all() == of_probes.any():
            result[block] = is_traced[block] & of_probes.any()
    return result


@pytest.mark.parametrize(
    "light",
    [
        LightGeometry("point", (0.9, 1.4, 0.6)),
        LightGeometry("spot", (0.9, 1.4, 0.6), (-0.6, -1.0, -0.4), cone=(10.0, 40.0)),
        LightGeometry("directional", direction=(-1.0, -1.0, -0.3)),
        LightGeometry("rectangle", (0.9, 1.4, 0.6), (-1.0, -1.0, 0.0), size=(0.5, 0.8)),
    ],
    ids=lambda light: light.kind,
)
def test_blocks_are_predicted_if_their_samples_agree(surfaces, light):
    geometry, position, normal = surfaces
    made = prepare_local_lights(light)
    strata = make_light_strata(made, 4)
    along = (made, strata, make_surface_points(position, normal))
    rough = trace_moving_light(geometry.embree, *along)
    visible, is_traced = (
        np.unpackbits(trace_light_visibility(scene, *along), axis=1, bitorder="little")[:, : len(strata.uv)] > 0
        for scene in (geometry.embree, FAR)
    )
    expected = np.packbits(predicted(visible, is_traced), axis=1, bitorder="little")
    np.testing.assert_array_equal(rough.visible, expected)
    np.testing.assert_allclose(rough.irradiance, compute_irradiance(*along, expected), rtol=2e-6)
    wrong = np.unpackbits(rough.visible ^ np.packbits(visible, axis=1, bitorder="little"))
    assert wrong.sum() < 0.02 * visible.size
    assert 0.05 < visible.mean() < 0.95


def test_unlit_points_stay_dark(surfaces):
    geometry, position, normal = surfaces
    made = prepare_local_lights(LightGeometry("point", (0.9, 1.4, 0.6)))
    strata = make_light_strata(made, 4)
    points = make_surface_points(position, normal)._replace(normal=0 * normal)
    rough = trace_moving_light(geometry.embree, made, strata, points)
    assert not rough.irradiance.any()
    assert not rough.visible.any()
