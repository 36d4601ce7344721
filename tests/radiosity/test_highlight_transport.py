"""Direct light on patches with narrow highlights, by tables, against the BRDF itself."""

import numpy as np
import numpy_reference as ref
import pytest

from relume.brdf.albedo import material_reflectance, narrow_lobes, reflectance_matrix
from relume.brdf.evaluate import eval_brdf
from relume.brdf.frozen_term import FrozenTerm
from relume.brdf.highlight_tables import lobe_table
from relume.lights.spherical_triangles import tessellate_environment
from relume.math.direction_grid import (
    NUM_FINE_BINS,
    SIDE,
    bin_index,
    bin_solid_angles,
    directions_at,
    fine_bin_centers,
    reflected_bins,
)
from relume.patches.patches import patch_sample_points
from relume.radiosity.highlight_transport import DirectLobes, outgoing_in_highlights
from relume.radiosity.outgoing_radiance import BinnedRadiance, first_bounce
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight
from relume.raytrace.gather_rays import make_pattern

PLAIN = {"texture": None, "curves": {}}
NUM_PATCHES = 12


def metal(roughness, color=(1.0, 1.0, 1.0)):
    return {**PLAIN, "model": "ggx", "color": list(color), "params": {"roughness": roughness, "f0": 0.9}}


DIFFUSE = {**PLAIN, "model": "lambert", "color": [0.3, 0.2, 0.1], "params": {}}


def patches_with_normals(normal):
    rng = np.random.default_rng(4)
    visible = rng.integers(0, 256, (NUM_PATCHES, 4, 6)).astype(np.uint8)
    hits = np.zeros((NUM_PATCHES, 4 * 5), np.uint16)
    material, white = np.zeros(NUM_PATCHES, np.uint16), np.ones((2, NUM_PATCHES, 3), np.float32)
    points = patch_sample_points(normal, normal)
    return PatchLight(points, visible, hits, make_pattern(5, 0, 9), material, white)


def flat(spread=0.0):
    rng = np.random.default_rng(7)
    normals = np.repeat(ref.unit(rng.normal(size=(NUM_PATCHES, 1, 3))), 4, axis=1)
    return ref.unit(normals + spread * rng.normal(size=normals.shape)).astype(np.float32)


@pytest.fixture(scope="module")
def lights():
    return tessellate_environment(np.random.default_rng(3).random((16, 32, 3), np.float32), 48)


def mean_over_bins(document, wi):
    """Cosine-weighted mean of a term over 64 positions of each direction bin, for light from `wi`. (3, bins)"""
    offsets = (np.arange(SIDE * 8) + 0.5) * (2 / (SIDE * 8)) - 1
    x, y = np.meshgrid(offsets, offsets, indexing="ij")
    wo = directions_at(x, y)
    weight = np.where(x * x + y * y < 1, wo[..., 2] * (1 + wo[..., 2]) ** 2, 1e-12)
    value = eval_brdf(document, wi, wo) * weight[..., None]
    bins = SIDE, 8, SIDE, 8
    return (
        (value.reshape(*bins, 3).sum(axis=(1, 3)) / weight.reshape(bins).sum(axis=(1, 3))[..., None])
        .reshape(SIDE * SIDE, 3)
        .T
    )


@pytest.mark.parametrize("roughness", [0.3, 0.5])
def test_tables_are_means_over_bins(roughness):
    table, document, area = lobe_table(FrozenTerm.from_document(metal(roughness))), metal(roughness), bin_solid_angles()
    for b in (0, 60, 200):
        exact = mean_over_bins(document, fine_bin_centers()[b])
        missed = np.sqrt(np.sum(area * (table[b] - exact) ** 2) / np.sum(area * exact**2))
        assert missed < 0.03


@pytest.mark.parametrize("roughness", [0.03, 0.1])
def test_tables_of_lobes_narrower_than_bins_preserve_energy(roughness):
    """A mirror at normal incidence reflects 0.9, wherever the lobe lies in a bin."""
    outgoing = lobe_table(FrozenTerm.from_document(metal(roughness)))[:60] @ bin_solid_angles()
    np.testing.assert_allclose(outgoing, 0.9, rtol=0.02)


def test_reflection_symmetries_permute_bins_like_directions():
    rng = np.random.default_rng(1)
    wo = ref.unit(rng.normal(size=(500, 3))) * [1, 1, np.sign(1)]
    wo[:, 2] = np.abs(wo[:, 2])
    for mirroring, bins in enumerate(reflected_bins()):
        moved = wo * [-1 if mirroring & 1 else 1, -1 if mirroring & 2 else 1, 1]
        moved = moved[:, [1, 0, 2]] if mirroring & 4 else moved
        np.testing.assert_array_equal(bins[bin_index(wo)], bin_index(moved))


def expected(patches, lights, documents, patch):
    """Outgoing radiance of a patch by bins, light by light and point by point. (3, bins)"""
    t, b = patches.frames[patch].astype(float)
    n, out = np.cross(t, b), np.zeros((3, SIDE * SIDE))
    for p, normal in enumerate(patches.points.normal.reshape(-1, 4, 3)[patch].astype(float)):
        visible = np.unpackbits(patches.visible[patch, p], bitorder="little")[: lights.num_lights]
        for m in np.flatnonzero(visible):
            d = lights.direction[m].astype(float)
            if (cosine := d @ normal) <= 0:
                continue
            away = 2 * cosine * normal - d  # reflected about the normal of the point, and back about that of the patch
            like = 2 * (n @ away) * n - away
            wi = np.array([t @ like, b @ like, max(n @ like, 1e-3)])
            values = sum(mean_over_bins(document, wi / np.linalg.norm(wi)) for document in documents)
            out += cosine / 4 * lights.irradiance[m].astype(float)[:, None] * values
    return out


@pytest.mark.parametrize("spread", [0.0, 0.1])
def test_patches_reflect_lights_with_their_highlights(lights, spread):
    patches, documents = patches_with_normals(flat(spread)), [metal(0.5, (0.5, 0.8, 0.3))]
    reflectances = (material_reflectance([DIFFUSE, *documents]),)
    lobes = patches.highlight_tables(reflectances, patches.reflectance_operator(reflectances))
    actual = outgoing_in_highlights(patches, lobes, DirectLobes(lights, patches.visibility_bits(lobes.rows)))
    area = bin_solid_angles()
    exact = expected(patches, lights, reflectances[0].lobes, 3)
    assert np.sqrt(np.sum(area * (actual[3] - exact) ** 2) / np.sum(area * exact**2)) < 0.06
    np.testing.assert_allclose(actual[3] @ area, exact @ area, rtol=0.04)


_LOCAL = fine_bin_centers()[60]


class _OneRay:
    """Light that reaches every point from one direction, as one ray."""

    max_rays_per_point = 1

    def list_into(self, listed, receivers, start, stop):
        num = stop - start
        listed.first[: num + 1] = np.arange(num + 1)
        listed.wi[:, :num], listed.irradiance[:, :num] = _LOCAL[:, None], [[1], [2], [3]]
        return num


def test_rays_of_local_lights_are_reflected_like_lights():
    patches, reflectances = patches_with_normals(flat()), (material_reflectance([metal(0.3)]),)
    lobes = patches.highlight_tables(reflectances, patches.reflectance_operator(reflectances))
    actual = outgoing_in_highlights(patches, lobes, DirectLobes(rays=[_OneRay()]))
    exact = mean_over_bins(reflectances[0].lobes[0], _LOCAL) * [[1], [2], [3]]
    for patch in range(NUM_PATCHES):
        assert np.linalg.norm(actual[patch] - exact) < 0.03 * np.linalg.norm(exact)


def test_highlights_are_not_counted_twice(lights):
    """With a table, basis functions and the isotropic part represent only diffuse terms."""
    patches = patches_with_normals(flat())
    glossy, diffuse = ((material_reflectance(terms),) for terms in ([DIFFUSE, metal(0.3)], [DIFFUSE]))
    reflecting, plain = patches.reflectance_operator(glossy), patches.reflectance_operator(diffuse)
    rows = reflecting.rows
    incident = IncidentLight(patches.irradiance(lights), patches.incident_coefficients(rows, lights, 6))
    lobes = patches.highlight_tables(glossy, reflecting)
    actual = first_bounce(reflecting, incident, (lobes, np.zeros((NUM_PATCHES, 3, SIDE * SIDE), np.float32)))
    held = plain.reflectance * reflecting.energy_scale
    np.testing.assert_allclose(actual.isotropic, held / np.pi * incident.irradiance, atol=1e-5)
    assert not actual.coefficients.any()


def test_only_highlights_beyond_the_basis_have_tables():
    assert narrow_lobes([metal(0.8)]) == []
    assert narrow_lobes([{**metal(0.2), "params": {"roughness": 0.2, "f0": 0.0}, "color": [0.1, 0.1, 0.1]}]) == []
    assert len(narrow_lobes([metal(0.2), metal(0.8)])) == 2  # all terms of a material or none
    patches = patches_with_normals(flat())
    reflectances = (material_reflectance([metal(0.8)]),)
    lobes = patches.highlight_tables(reflectances, patches.reflectance_operator(reflectances))
    assert len(lobes.rows) == 0
    assert outgoing_in_highlights(patches, lobes, DirectLobes()).shape == (0, 3, SIDE * SIDE)


def test_small_edits_do_not_change_the_light():
    assert material_reflectance([metal(0.3)]) == material_reflectance([metal(0.3001)])
    assert material_reflectance([metal(0.3)]) != material_reflectance([metal(0.31)])
    before, after = material_reflectance([metal(0.3)]).lobes, material_reflectance([metal(0.31)]).lobes
    assert abs(before[0]["params"]["roughness"] - 0.3) < 0.003
    assert abs(after[0]["params"]["roughness"] - 0.31) < 0.003
    assert abs(reflectance_matrix(before[0])[0, 0] - reflectance_matrix(metal(0.3))[0, 0]) < 0.01


def test_bins_are_subtracted_patch_by_patch():
    ones = np.ones((2, 3, SIDE * SIDE), np.float32)
    difference = BinnedRadiance(np.array([1, 4]), 3 * ones).subtract(BinnedRadiance(np.array([4, 7]), ones))
    np.testing.assert_array_equal(difference.rows, [1, 4, 7])
    np.testing.assert_array_equal(difference.radiance[:, 0, 0], [3, 2, -1])


def test_every_bin_has_one_number():
    assert len(fine_bin_centers()) == NUM_FINE_BINS
    assert (fine_bin_centers()[:, 0] >= fine_bin_centers()[:, 1] - 1e-12).all()
