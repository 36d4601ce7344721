"""Gradients of highlights between probes, and their use in pixels."""

from dataclasses import replace

import numpy as np
import pytest
from probe_shading import shade_probes_numpy
from tiny_scenes import make_camera, make_tiny_scene, sphere, studio

from relume.core.cache import Cache
from relume.core.color import LUMINANCE
from relume.live.free_camera.basis.highlight_lobes import Lobes, build_lobes
from relume.live.free_camera.basis.material_tables import Tables, build_tables, window
from relume.live.free_camera.basis.outgoing_coefficients import NUM_ROWS
from relume.live.free_camera.basis.table_index import MIN_COSINE
from relume.live.free_camera.environment_lookup import rotation_of
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.highlights.lobe_gradients import F32, F64, gradients_along_lobe
from relume.live.free_camera.primary_visibility import interpolate_to_nodes, trace_primary
from relume.live.free_camera.shade_pixels import InterpolatedProbes, MirrorData, shade_pixels
from relume.live.free_camera.shade_probes import shade_probes
from relume.live.opened.openers import open_bake
from relume.math.zernike import DEGREES, WINDOW_DECAY, basis_functions
from relume.methods.registry import METHODS
from relume.probes.stored_scene import StoredScene
from relume.raytrace.surface_points import SurfacePoints
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA, SIZE = make_camera("front", [0, 0.5, 3], [0, 0, 0], 0.75), (64, 48)
CAMERA_POSITION = CAMERA.to_world[:3, 3].astype(np.float32)
WHITE = {"model": "ggx", "color": [1.0] * 3, "texture": None, "curves": {}}
COAT = {**WHITE, "params": {"roughness": 0.3, "f0": 0.05}}
METAL = {**WHITE, "color": [0.9, 0.6, 0.3], "params": {"roughness": 0.4, "f0": 0.9}}


_DIFFERENCE_STEP = 1e-5  # radians


def gradients_along_lobe_numpy(
    stored_scene: StoredScene, non_environment: F32, tables: Tables, lobes: Lobes, camera_position: F32, probe: int
) -> F64:
    """Reference of `gradients_along_lobe` for one probe: finite differences of `shade_probes_numpy`.

    Args:
        stored_scene, non_environment, tables, lobes, camera_position: as there. probe: index of a probe with a
        lobe.
    Returns:
        (4,) float64
    """
    n, position = (
        array[probe].astype(np.float64) for array in (stored_scene.probes.normal, stored_scene.probes.position)
    )
    to_camera, lobe = camera_position - position, lobes.lobe_index[stored_scene.material[probe]]
    distance, tangents = float(np.linalg.norm(to_camera)), np.linalg.svd(to_camera[None])[2][1:]

    def outgoing_luminance(direction: F64) -> float:
        outgoing, _ = shade_probes_numpy(
            stored_scene,
            np.zeros_like(non_environment),
            non_environment,
            tables,
            position + distance * direction,
            probe,
        )
        rows = np.sqrt(1 - np.clip(direction @ n, MIN_COSINE, 1)) * (NUM_ROWS - 1)
        row_albedo = lobes.albedo[lobe].sum(axis=1).astype(np.float64)
        albedo = [np.interp(rows, np.arange(NUM_ROWS), row_albedo[:, channel]) for channel in range(3)]
        return float(outgoing.sum(axis=0) / np.maximum(albedo, 1e-30) @ LUMINANCE)

    wo, gradient = to_camera / distance, np.zeros(3)
    for across in tangents:
        forward, backward = (wo + sign * _DIFFERENCE_STEP * across for sign in (1, -1))
        change = outgoing_luminance(forward / np.linalg.norm(forward)) - outgoing_luminance(
            backward / np.linalg.norm(backward)
        )
        gradient += change / (2 * _DIFFERENCE_STEP) * (2 * (n @ across) * n - across)
    return np.append(gradient, gradient @ (2 * (n @ wo) * n - wo))


@pytest.fixture(scope="module")
def free_bake(tmp_path_factory):
    material = Material("Ball", ({"model": "lambert", "color": [1.0, 1.0, 1.0]},))
    ball = sphere("ball", [0, 0, 0], 1, 0, 24)
    scene = make_tiny_scene(ball, camera=CAMERA, environment=studio(16, 20.0), materials=[material])
    store = tmp_path_factory.mktemp("ball") / "probes.zarr"
    bake_in_process(METHODS["probes"], scene, Recipe("probes", ("front",), SIZE, 60, num_probes=1500), store)
    return open_bake(store, Cache(1 << 30))


def distant_light(points):
    """Incident radiance coefficients of a few distant unoccluded lights. (probes, 3, K) float32"""
    rng = np.random.default_rng(3)
    towards, light = rng.normal(size=(12, 3)), rng.uniform(0, 2, (12, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    n, t = points.normal.astype(np.float64), points.tangent.astype(np.float64)
    wi = np.einsum("nij,lj->nli", np.stack([t, np.cross(n, t), n], axis=1), towards)
    cosine = np.maximum(wi[..., 2], 0)
    return np.einsum("nl,lc,nlk->nck", cosine, light, basis_functions(wi)).astype(np.float32)


@pytest.mark.parametrize("terms", [[METAL], [METAL, COAT]])
def test_gradients_equal_finite_differences(free_bake, terms):
    surface, tables, lobes = free_bake.stored_scene, build_tables([terms]), build_lobes([terms])
    others, num = distant_light(surface.probes), surface.probes.num_points
    is_needed = (np.arange(num) % 3 > 0).astype(np.uint8)
    actual = gradients_along_lobe(surface.viewed_from(CAMERA_POSITION, is_needed), others, tables, lobes)
    assert not actual[is_needed == 0].any()
    expected = np.array(
        [gradients_along_lobe_numpy(surface, others, tables, lobes, CAMERA_POSITION, p) for p in range(0, num, 5)]
    )
    is_asked = is_needed[::5] > 0
    largest = np.abs(expected[is_asked]).max()
    assert largest > 0.1
    np.testing.assert_allclose(actual[::5][is_asked], expected[is_asked], rtol=2e-3, atol=2e-3 * largest)


def test_gradients_are_zero_without_highlight_or_light(free_bake):
    surface, num = free_bake.stored_scene, free_bake.stored_scene.probes.num_points
    dull, everywhere = [{**METAL, "model": "lambert", "params": {}}], np.ones(num, np.uint8)
    others = distant_light(surface.probes)
    viewed = surface.viewed_from(CAMERA_POSITION, everywhere)
    assert not gradients_along_lobe(viewed, others, build_tables([dull]), build_lobes([dull])).any()
    assert not gradients_along_lobe(viewed, 0 * others, build_tables([[METAL]]), build_lobes([[METAL]])).any()


def pixels(free_bake, gain):
    """Pixels of a metal ball in that light, with gradients times a gain; and with probes at the pixels."""
    surface, tables, lobes = free_bake.stored_scene, build_tables([[METAL]]), build_lobes([[METAL]])
    gbuffer = trace_primary(surface, free_bake.embree, CAMERA, SIZE).pixel_centers(SIZE[0] * SIZE[1])
    others, everywhere = distant_light(surface.probes), np.ones(surface.probes.num_points, np.uint8)
    viewed = surface.viewed_from(CAMERA_POSITION, everywhere)
    outgoing = shade_probes(viewed, np.zeros_like(others), others, tables).radiance
    gradients = np.float32(gain) * gradients_along_lobe(viewed, others, tables, lobes)
    broad, turn = (interpolate_to_nodes(surface, gbuffer.is_visible, values) for values in (outgoing, gradients))
    dark, nothing = np.zeros((1, 3), np.float32), np.empty((0, 3), np.float32)
    no_environment = PrefilteredEnvironment(
        free_bake.prefiltered(None), np.empty((0, 7), np.float32), rotation_of(0.0), dark[0]
    )
    mirrored = MirrorData(lobes, no_environment, np.zeros((len(turn), 3), np.float32), turn, False)
    shown = InterpolatedProbes(broad, np.ones((1, broad.shape[1]), bool), nothing)
    radiance = shade_pixels(surface, gbuffer, CAMERA.yfov / SIZE[1], shown, dark, mirrored)

    hit = np.flatnonzero(gbuffer.hits.face >= 0)
    position = CAMERA_POSITION + gbuffer.hits.distance[hit, None] * gbuffer.directions[hit]
    normal = np.einsum("nk,nkc->nc", gbuffer.weight[hit], surface.lattice_nodes.normal[gbuffer.lattice_node[hit]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    tangent = np.cross(normal, [0.0, 0.0, 1.0])
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    fields = (np.ascontiguousarray(values, np.float32) for values in (position, normal, tangent))
    points = SurfacePoints(*fields, hit.astype(np.uint32))
    exactly = replace(surface, probes=points, material=np.zeros(len(hit), surface.material.dtype))
    light, viewed = distant_light(points), exactly.viewed_from(CAMERA_POSITION, np.ones(len(hit), np.uint8))
    expected = shade_probes(viewed, np.zeros_like(light), light, tables).radiance[:, 0]
    inside = np.einsum("nc,nc->n", normal, -gbuffer.directions[hit]) > 0.3
    return radiance[hit][inside], expected[inside]


def test_half_gradients_improve_values_between_probes(free_bake):
    def error(gain):
        actual, expected = pixels(free_bake, gain)
        return np.sqrt(np.mean((actual - expected) ** 2) / np.mean(expected**2))

    plain, half, whole = error(0), error(1), error(2)
    assert plain > 0.03
    assert half < 0.5 * plain
    assert half < whole


def test_a_gradient_changes_pixels_within_bounds(free_bake):
    plain, _ = pixels(free_bake, 0)
    wild, _ = pixels(free_bake, 1e4)
    ratio = wild[plain > 1e-3] / plain[plain > 1e-3]
    np.testing.assert_allclose([ratio.min(), ratio.max()], [0.875, 1.125], rtol=1e-3)


def test_the_window_applies_to_functions_with_large_residuals():
    np.testing.assert_array_equal(window(0.0), 1)
    np.testing.assert_allclose(window(0.9), np.exp(-WINDOW_DECAY * DEGREES * (DEGREES + 2)), rtol=1e-6)
    assert np.all(window(0.9)[1:] < window(0.3)[1:])
    assert np.all(np.diff(window(0.3)) <= 0)
