"""Low-frequency light: spherical harmonics, transferred to probes by precomputed matrices, compressed by local PCA."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from session_edits import relative_rmse

from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.lights.frequency_split import split_frequencies
from relume.lights.spherical_triangles import EnvironmentTexels, integrate_environment
from relume.lights.tile_subdivision import choose_tiles
from relume.math.local_pca import leading_components
from relume.math.spherical_harmonics import NUM_HARMONICS, harmonics
from relume.math.zernike import basis_functions, num_functions
from relume.patches.patch_kdtree import NO_PATCH
from relume.raytrace.gather_rays import make_pattern
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.raytrace.visibility import select_visibility
from relume.transport.clustered_rays import shared_direction_coefficients, weighted_basis
from relume.transport.direction_bins import outgoing_bins
from relume.transport.incident_coefficients import incident_coefficients, ray_incident_coefficients
from relume.transport.outgoing_patch_light import NUM_OUTGOING, isotropic, radiance_from_patch
from relume.transport.sh_transfer import F32, F64, ClusteredTransfer, transfer_matrices
from relume.transport.shading_points import GatherRays

DEGREE = 4
WHITE = np.ones((128, 256, 3), np.float32)
TILES = choose_tiles(WHITE, 300, True)
NUM_LIGHTS = len(TILES.codes)
BROUGHT = harmonics(TILES.centroids) * TILES.solid_angles[:, None]


def transfer_matrices_numpy(
    points: SurfacePoints, visible: NDArray[np.uint8], directions: F32, solid_angles: F64
) -> F64:
    """Reference of `transfer_matrices` for the whole hemispherical basis, in plain NumPy.

    Args:
        points, visible, directions, solid_angles: as there.
    Returns:
        (n, K, NUM_HARMONICS) float64
    """
    n, t = points.normal.astype(np.float64), points.tangent.astype(np.float64)
    wi = np.einsum("nij,mj->nmi", np.stack([t, np.cross(n, t), n], axis=1), directions.astype(np.float64))
    is_visible = np.unpackbits(visible, axis=1, count=len(directions), bitorder="little")
    weight = is_visible * np.maximum(wi[..., 2], 0) * solid_angles
    return np.asarray(
        np.einsum("nm,nmk,mj->nkj", weight, basis_functions(wi), harmonics(directions.astype(np.float64)))
    )


def lights_of(radiance):
    """Triangles with shadow rays through their centers."""
    return replace(
        integrate_environment(TILES, EnvironmentTexels.from_radiance(radiance)),
        direction=TILES.centroids.astype(np.float32),
    )


def points_on_a_ball(num, seed=3):
    """Points with random bits."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(num, 3)).astype(np.float32)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    bits = rng.integers(0, 256, (num, -(-NUM_LIGHTS // 8)), dtype=np.uint8)
    return SurfacePoints(normal, normal, any_tangent(normal), np.zeros(num, np.uint32)), bits


def matrices_of(points, visible):
    return transfer_matrices(points, visible, TILES.centroids.astype(np.float32), TILES.solid_angles, DEGREE)


def test_harmonics_are_orthonormal_over_the_sphere():
    directions = texel_directions(256, 512).reshape(-1, 3)
    weight = np.repeat(texel_solid_angles(256, 512), 512)
    values = harmonics(directions)
    np.testing.assert_allclose((values * weight[:, None]).T @ values, np.eye(NUM_HARMONICS), atol=1e-3)


def test_matrices_equal_their_reference():
    points, visible = points_on_a_ball(40)
    actual = matrices_of(points, visible)
    exact = transfer_matrices_numpy(points, visible, TILES.centroids.astype(np.float32), TILES.solid_angles)
    exact = exact[:, : num_functions(DEGREE)]
    assert np.abs(actual - exact).max() < 1e-5 * np.abs(exact).max()


def test_low_frequency_light_equals_that_of_all_triangles():
    points, visible = points_on_a_ball(40)
    smooth = np.random.default_rng(2).normal(size=(NUM_HARMONICS, 3))
    lights = replace(lights_of(WHITE), irradiance=(BROUGHT @ smooth).astype(np.float32))
    exact = incident_coefficients(points, visible, lights, (), DEGREE)
    actual = np.einsum("nkl,lc->nck", matrices_of(points, visible), smooth)
    assert relative_rmse(actual, exact) < 1e-5


@pytest.mark.parametrize("has_bright_light", [0.0, 300.0], ids=["overcast", "a bright light in it"])
def test_split_light_equals_whole_light(has_bright_light):
    radiance = WHITE * np.linspace(2, 0.5, 128, dtype=np.float32)[:, None, None]
    radiance[32:36, 56:60] += has_bright_light
    lights, (points, visible) = lights_of(radiance), points_on_a_ball(200)
    divided = split_frequencies(lights, BROUGHT)
    assert len(divided.residual_triangles) < 0.1 * NUM_LIGHTS
    every = np.arange(points.num_points)
    beyond = incident_coefficients(
        points, select_visibility(visible, every, divided.residual_triangles), divided.residual, (), DEGREE
    )
    actual = beyond + np.einsum("nkl,lc->nck", matrices_of(points, visible), divided.low_frequency)
    exact = incident_coefficients(points, visible, lights, (), DEGREE)
    assert relative_rmse(actual, exact) < 0.03
    harmonics_alone = np.einsum(
        "nkl,lc->nck", matrices_of(points, visible), harmonics(TILES.centroids).T @ lights.irradiance
    )
    if has_bright_light:
        assert relative_rmse(harmonics_alone, exact) > 0.3


def test_black_light_is_split_into_nothing():
    divided = split_frequencies(lights_of(0 * WHITE), BROUGHT)
    assert not divided.low_frequency.any()
    assert divided.residual.num_lights == len(divided.residual_triangles) == 0


def test_clusters_represent_matrices_of_other_points(monkeypatch):
    monkeypatch.setattr("relume.transport.sh_transfer._MAX_FITTED_POINTS", 1500)
    monkeypatch.setattr("relume.transport.sh_transfer._POINTS_PER_BATCH", 700)
    points, _ = points_on_a_ball(3000)
    visible = TILES.centroids[:, 1] > 0.3 * points.normal[:, :1]  # shadows that vary slowly between points
    matrices = matrices_of(points, np.packbits(visible, axis=1, bitorder="little"))
    clustered = ClusteredTransfer.fit(len(matrices), lambda rows: matrices[rows], np.random.default_rng(1))
    rows = np.arange(5, 3000, 7)
    smooth = np.random.default_rng(2).normal(size=(NUM_HARMONICS, 3)).astype(np.float32)
    exact = np.einsum("nkl,lc->nck", matrices[rows], smooth)
    assert relative_rmse(clustered.incident_coefficients(smooth, rows), exact) < 0.06
    mean = clustered._replace(weight=0 * clustered.weight)
    assert relative_rmse(mean.incident_coefficients(smooth, rows), exact) > 0.15


def test_few_rows_have_the_accuracy_of_many():
    rows = np.random.default_rng(4).normal(size=(6, 40)).astype(np.float32) * np.array([[9], [7], [5], [3], [2], [1]])
    wide, tall = (
        leading_components(rows, 3),
        leading_components(np.concatenate([rows, np.zeros((60, 40), np.float32)]), 3),
    )
    np.testing.assert_allclose(np.abs(np.sum(wide * tall, axis=1)), 1, atol=1e-4)


def test_selected_lights_keep_their_visibility():
    visible = np.random.default_rng(6).integers(0, 256, (20, 9), dtype=np.uint8)
    rows, lights = np.array([3, 0, 19]), np.array([0, 7, 8, 22, 23, 40, 55, 56, 70])
    bits = np.unpackbits(visible, axis=1, bitorder="little")[rows][:, lights]
    actual = np.unpackbits(select_visibility(visible, rows, lights), axis=1, count=len(lights), bitorder="little")
    np.testing.assert_array_equal(actual, bits)


def test_shared_directions_equal_listed_rays():
    points, _ = points_on_a_ball(50)
    pattern, rng = make_pattern(64, 0, 11), np.random.default_rng(7)
    hits = rng.integers(0, 30, (50, 64)).astype(np.uint16)
    hits[rng.random(hits.shape) < 0.1] = NO_PATCH
    even = np.zeros((NO_PATCH + 1, 3), np.float32)
    even[:30] = rng.random((30, 3))
    lobed = np.array([2, 7, 8, 29])
    frame = np.linalg.qr(rng.normal(size=(30, 3, 2)))[0].transpose(0, 2, 1).astype(np.float32)
    some = radiance_from_patch(even, lobed, frame[lobed], rng.normal(size=(4, 3, NUM_OUTGOING)).astype(np.float32))
    rows, bins = np.array([1, 4, 30, 49]), outgoing_bins(points, hits, pattern, frame)
    for outgoing in (isotropic(even), some):
        actual = shared_direction_coefficients(hits, bins, rows, weighted_basis(pattern, 0, DEGREE), outgoing)
        exact = ray_incident_coefficients(points, [GatherRays(hits, pattern, outgoing)], DEGREE)[rows]
        assert relative_rmse(actual, exact) < 1e-5


def test_glossy_rays_have_no_shared_directions():
    with pytest.raises(ValueError, match="another direction"):
        weighted_basis(make_pattern(64, 8, 11), 0, DEGREE)
