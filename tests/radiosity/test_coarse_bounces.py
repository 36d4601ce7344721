"""Fast indirect light during edits, against exact light."""

import numpy as np
import numpy_reference as ref
import pytest
from session_edits import relative_rmse

from relume.brdf.albedo import material_reflectance
from relume.lights.spherical_triangles import tessellate_environment
from relume.math.zernike import OUTGOING_DEGREE
from relume.patches.patch_kdtree import NO_PATCH
from relume.patches.patches import patch_sample_points
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight
from relume.radiosity.solve_bounces import Directions, OutgoingRadiance, solve_bounces
from relume.raytrace.gather_rays import cosine_ray, lattice_offsets, make_pattern
from relume.transport.direction_bins import incoming_bins, outgoing_bins
from relume.transport.outgoing_patch_light import NUM_OUTGOING, bin_means, bin_of

NUM_PATCHES = 60
PLAIN = {"texture": None, "params": {}, "curves": {}}
DIFFUSE = material_reflectance([{**PLAIN, "model": "lambert", "color": [0.5, 0.4, 0.3]}])
SHINY = material_reflectance(
    [{**PLAIN, "model": "blinn_phong", "color": [0.4, 0.3, 0.5], "params": {"exponent": 20.0}}]
)


@pytest.fixture(scope="module")
def patches():
    """Flat patches whose rays hit each other at random; a tenth hits nothing."""
    rng = np.random.default_rng(4)
    normal = np.repeat(ref.unit(rng.normal(size=(NUM_PATCHES, 1, 3))), 4, axis=1).astype(np.float32)
    visible = rng.integers(0, 256, (NUM_PATCHES, 4, 5)).astype(np.uint8)
    hits = rng.integers(0, NUM_PATCHES, (NUM_PATCHES, 4 * 55)).astype(np.uint16)
    hits[rng.random(hits.shape) < 0.1] = NO_PATCH
    material, white = np.arange(NUM_PATCHES).astype(np.uint16) % 2, np.ones((2, NUM_PATCHES, 3), np.float32)
    return PatchLight(patch_sample_points(normal, normal), visible, hits, make_pattern(55, 0, 9), material, white)


@pytest.fixture(scope="module")
def incident_light(patches):
    lights = tessellate_environment(np.random.default_rng(3).random((16, 32, 3), np.float32), 40)
    return IncidentLight(
        patches.irradiance(lights), patches.incident_coefficients(np.arange(1, NUM_PATCHES, 2), lights, OUTGOING_DEGREE)
    )


def test_direction_bins_equal_those_of_the_rays(patches):
    points, hits, pattern, frames = (
        patches.points,
        patches.gather_hits.reshape(-1, 55),
        patches.pattern,
        patches.frames,
    )
    leaving = outgoing_bins(points, hits, pattern, frames)
    coming = incoming_bins(points, 4, pattern, frames)
    for p in (0, 7, 100):
        shift = lattice_offsets(pattern, points.seed[p])[0]
        n, t = points.normal[p], points.tangent[p]
        for ray in range(55):
            away = np.array(cosine_ray(pattern.rays[ray], shift)) @ np.array([t, np.cross(n, t), n])
            assert coming[p, ray] == bin_of(frames, p // 4, *away.astype(np.float32))
            patch = hits[p, ray]
            assert leaving[p, ray] == (0 if patch == NO_PATCH else bin_of(frames, patch, *-away.astype(np.float32)))


def test_fast_incident_light_equals_that_of_direction_bins(patches, incident_light):
    reflecting = patches.reflectance_operator((DIFFUSE, SHINY))
    even, vectors = reflecting.apply(incident_light)
    now = OutgoingRadiance(even, reflecting.rows, vectors, reflecting.roughening).outgoing_light(patches)
    exact, quick = (
        patches.incident_light(now, reflecting.rows),
        patches.incident_light(now, reflecting.rows, is_binned=True),
    )
    np.testing.assert_allclose(quick.irradiance, exact.irradiance, rtol=1e-4)
    assert relative_rmse(quick.coefficients[..., :6], exact.coefficients[..., :6]) < 0.05
    in_squares, lobe = np.zeros((30, 3, NUM_OUTGOING)), now.lobe[patches.gather_hits]
    light = now.isotropic[patches.gather_hits].astype(float)
    light += np.where(lobe[..., None] >= 0, now.scale[lobe] * now.table[lobe, patches.outgoing_bins], 0)
    for row, patch in enumerate(reflecting.rows):
        in_squares[row] = np.pi / 220 * light[patch].T @ bin_means().T[patches.incident_bins[patch]]
    np.testing.assert_allclose(quick.coefficients, in_squares, atol=1e-5)


@pytest.mark.parametrize(("first", "last"), [(1, 1), (1, 24), (2, 2), (3, 5)])
@pytest.mark.parametrize("wall", [DIFFUSE, SHINY])
def test_fast_bounces_are_near_exact_bounces(patches, incident_light, wall, first, last):
    reflecting = patches.reflectance_operator((DIFFUSE, wall))
    incident = IncidentLight(incident_light.irradiance, incident_light.coefficients[: len(reflecting.rows)])
    exact, quick = (
        solve_bounces(patches, reflecting, incident, first, last, directions=directions)
        for directions in (Directions.EXACT, Directions.BINNED)
    )
    assert relative_rmse(quick.isotropic, exact.isotropic) < 0.03
    assert np.linalg.norm(quick.coefficients - exact.coefficients) <= 0.05 * np.linalg.norm(exact.coefficients)


def test_a_difference_contains_the_rows_of_both():
    rng = np.random.default_rng(1)
    even, vectors = rng.random((2, 5, 3)).astype(np.float32), rng.random((2, 2, 3, NUM_OUTGOING)).astype(np.float32)
    falls = np.array([[0.1, 0.2], [0.3, 0.4]], np.float32)
    left, right = (
        OutgoingRadiance(even[k], np.array(rows), vectors[k], falls[k]) for k, rows in enumerate(([0, 3], [3, 4]))
    )
    difference = left.subtract(right)
    np.testing.assert_array_equal(difference.isotropic, even[0] - even[1])
    np.testing.assert_array_equal(difference.rows, [0, 3, 4])
    np.testing.assert_array_equal(difference.roughening, [falls[0, 0], falls[0, 1], falls[1, 1]])
    np.testing.assert_array_equal(
        difference.coefficients, [vectors[0, 0], vectors[0, 1] - vectors[1, 0], -vectors[1, 1]]
    )
