"""The projector against NumPy, against all texels, and against itself: the choice of the free curve must not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest
from analytic_terms import ANALYTIC
from tiny_scenes import studio

from relume.brdf.curves import curve_bands
from relume.brdf.evaluate import angles_numpy
from relume.brdf.registry import TERMS
from relume.brdf.term import Angle
from relume.lights.spherical_triangles import tessellate_environment
from relume.transport.projector import Projector
from relume.transport.term_contraction import contract

NUM_POINTS = 40
# every curve of the transport, and every pair of curves of a term
CURVES = [(model, c.name) for model, term in ANALYTIC.items() for c in term.curves if not c.depends_on_view]
# tolerance of the linear approximation of an angle, in bands: docs/direct-light.md#algorithm
TOLERANCE_BANDS, TOLERANCE_SHARE = 0.12, 0.015


@pytest.fixture(scope="module")
def lights():
    return tessellate_environment(studio(), 200)


@pytest.fixture(scope="module")
def receivers(lights):
    return ref.only_above(ref.make_random_receivers(NUM_POINTS, lights.num_lights, seed=1), lights)


def default_bands(model, **params):
    document = {"model": model, "params": params}
    return {curve.name: curve_bands(document, curve) for curve in TERMS[model].curves}


def colored_bands(model, seed=0):
    """Wavy curves, different in each channel, nowhere constant and nowhere zero."""
    rng = np.random.default_rng(seed)
    bands = {}
    for curve in TERMS[model].curves:
        x = np.linspace(0, 1, curve.num_bands)
        waves = rng.uniform(0.2, 1, (3, 1)) + 0.15 * np.sin(rng.uniform(3, 12, (3, 1)) * x)
        bands[curve.name] = waves + 2 * np.exp(-x / 0.2)
    return bands


def project(model, bands, active, lights, receivers):
    term = TERMS[model]
    projector = Projector(term, contract(term, bands, active), lights, receivers)
    return projector.project(0, len(receivers.normal)).astype(float)


def image(model, bands, active, lights, receivers):
    """Σ_j c_j T_j with any free curve, or none. (n, 3)"""
    transport = project(model, bands, active, lights, receivers)
    return transport[:, 0] if active is None else np.einsum("njc,cj->nc", transport, bands[active])


def relative(actual, expected):
    """Largest difference relative to the largest value."""
    return np.abs(actual - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize(("model", "curve"), CURVES)
@pytest.mark.parametrize("bands_of", [default_bands, colored_bands])
def test_any_curve_can_be_free(model, curve, bands_of, lights, receivers):
    """T_A · c_A with B fixed = T_B · c_B with A fixed = no free curve (eqs. 23 and 26, for all terms)."""
    bands = bands_of(model)
    none = image(model, bands, None, lights, receivers)
    assert relative(image(model, bands, curve, lights, receivers), none) < 2e-6
    assert none.min() >= 0
    assert none.max() > 0


@pytest.mark.parametrize(("model", "curve"), CURVES)
def test_transport_is_linear_in_each_fixed_curve(model, curve, lights, receivers):
    first, second = colored_bands(model, 1), colored_bands(model, 2)
    for fixed in {c.name for c in TERMS[model].curves if not c.depends_on_view} - {curve}:
        parts = [
            project(model, {**first, fixed: curve_set[fixed]}, curve, lights, receivers)
            for curve_set in (first, second)
        ]
        combined = {**first, fixed: 2 * first[fixed] + 3 * second[fixed]}
        # thousands of subdivided triangles around a pole, each rounded to float32
        assert relative(project(model, combined, curve, lights, receivers), 2 * parts[0] + 3 * parts[1]) < 6e-6


@pytest.mark.parametrize(("model", "curve"), CURVES)
def test_transport_of_a_curve_does_not_depend_on_its_own_bands(model, curve, lights, receivers):
    bands_a, bands_b = colored_bands(model, 1), colored_bands(model, 2)
    first = project(model, bands_a, curve, lights, receivers)
    np.testing.assert_array_equal(first, project(model, {**bands_a, curve: bands_b[curve]}, curve, lights, receivers))


@pytest.mark.parametrize("curve", CURVES)
def test_band_fractions_of_every_triangle_sum_to_one(curve, lights):
    """With constant fixed curves of one, all bands of a light sum to its power · q · cos θi: Σ_j Δ_{m,j} = 1."""
    model, name = curve
    term = TERMS[model]
    ones = {c.name: np.ones((3, c.num_bands)) for c in term.curves}
    base, light_indices = (
        ref.make_random_receivers(8, lights.num_lights, seed=3),
        np.arange(0, lights.num_lights, 7),
    )
    point, light = (
        index.ravel() for index in np.meshgrid(np.arange(8), light_indices, indexing="ij")
    )  # each pair separately
    only = np.arange(lights.num_lights) == light[:, None]
    visible = np.packbits(only, axis=1, bitorder="little")
    frame = base.wo[point], base.normal[point], base.tangent[point]
    pairs = ref.only_above(ref.make_receivers_at_origin(*frame, visible), lights)
    pairs = replace(pairs, visible=pairs.visible & visible)
    sums = project(model, ones, name, lights, pairs).sum(axis=1)
    wi, wo = (np.einsum("nij,nj->ni", ref.frames(pairs), d) for d in (lights.direction[light], pairs.wo))
    shading = term.quotients(*wi.T, *wo.T).T * np.maximum(wi[:, 2:], 0)
    assert np.count_nonzero(pairs.visible) > 80  # the others lie below the horizon
    np.testing.assert_allclose(sums, lights.irradiance[light].astype(float) * shading, rtol=1e-5, atol=1e-12)


def test_constant_curves_are_factored_out(lights, receivers):
    for model in ANALYTIC:
        names = [c.name for c in TERMS[model].curves if not c.depends_on_view]
        flat = {c.name: np.full((3, c.num_bands), 0.5) * [[1], [2], [3]] for c in TERMS[model].curves}
        ones = {c.name: np.ones((3, c.num_bands)) for c in TERMS[model].curves}
        expected = image(model, ones, None, lights, receivers) * np.float64([0.5, 1.0, 1.5]) ** len(names)
        assert relative(image(model, flat, None, lights, receivers), expected) < 1e-6
        for name in names:
            assert relative(image(model, flat, name, lights, receivers), expected) < 2e-6


def test_nearly_constant_curves_equal_constant_ones(lights, receivers):
    """Constant curves and curves constant within 1e-9 give the same images, whichever curve is free."""
    for model in ("cook_torrance", "ggx", "ashikhmin_shirley"):
        bands = default_bands(model)
        names = [c.name for c in TERMS[model].curves if not c.depends_on_view]
        for name in names:
            flat = {**bands, name: np.full_like(bands[name], 0.7)}
            nearly = {**flat, name: flat[name] * (1 + 1e-9 * np.arange(flat[name].shape[1]))}
            expected = image(model, nearly, None, lights, receivers)
            for active in (None, *names):
                actual = image(model, flat, active, lights, receivers)
                error = np.sqrt(np.mean((actual - expected) ** 2) / np.mean(expected**2))
                assert error < 1e-5, (model, name, active)


@pytest.mark.parametrize(("model", "curve"), CURVES)
def test_culled_lights_have_no_effect(model, curve, lights, receivers):
    """A curve that ends early against the same one with a negligible tail that prevents culling."""
    for fixed in {c.name for c in TERMS[model].curves if not c.depends_on_view} - {curve}:
        bands = colored_bands(model)
        ends = bands[fixed].shape[1] // 6
        bands[fixed][:, ends:] = 0
        raised = {**bands, fixed: bands[fixed] + 1e-8 * bands[fixed].max()}
        for active in (curve, None):
            short = project(model, bands, active, lights, receivers)
            whole = project(model, raised, active, lights, receivers)
            assert relative(short, whole) < 4e-6
            assert short.max() > 0


@pytest.mark.parametrize(("start", "stop"), [(0, 0), (0, 1), (3, 17), (0, 48), (1, 49), (47, 130), (100, 131)])
def test_a_range_equals_the_rows_of_the_whole(start, stop, lights):
    receivers = ref.only_above(ref.make_random_receivers(131, lights.num_lights, seed=5), lights)
    bands = default_bands("cook_torrance")
    whole = project("cook_torrance", bands, "theta_h", lights, receivers)
    term = TERMS["cook_torrance"]
    projector = Projector(term, contract(term, bands, "theta_h"), lights, receivers)
    for _ in range(2):  # scratch memory keeps no state
        np.testing.assert_array_equal(projector.project(start, stop), whole[start:stop])


def test_hidden_lights_give_nothing_and_visible_ones_add_up(lights, receivers):
    bands, rng = default_bands("cook_torrance"), np.random.default_rng(6)
    some = receivers.visible & rng.integers(0, 256, receivers.visible.shape).astype(np.uint8)
    parts = [
        project(
            "cook_torrance",
            bands,
            "theta_d",
            lights,
            replace(receivers, visible=visible),
        )
        for visible in (some, receivers.visible & ~some, receivers.visible, np.zeros_like(some))
    ]
    assert relative(parts[0] + parts[1], parts[2]) < 3e-6
    assert not parts[3].any()


@pytest.mark.parametrize("model", ANALYTIC)
def test_the_projector_equals_numpy_with_exact_angles(model, lights, receivers):
    receivers = receivers.subset(np.arange(0, NUM_POINTS, 2))
    for bands in (default_bands(model), colored_bands(model)):
        actual = image(model, bands, None, lights, receivers)
        exact = ref.project(TERMS[model], bands, None, lights, receivers, depth=4)[:, 0]
        assert relative(actual, exact) < 0.01
        assert np.sqrt(np.mean((actual - exact) ** 2) / np.mean(exact**2)) < 0.01


@pytest.fixture(scope="module")
def many_lights():
    return tessellate_environment(studio(), 1400)


# one curve of each angle: with bands of one, models with a common angle differ in their quotients only
FINE_CURVES = {TERMS[model].curve(name).angle: (model, name) for model, name in reversed(CURVES)}
CREASED = (Angle.ALPHA, Angle.BETA, Angle.TILT_X, Angle.TILT_Y)


@pytest.mark.parametrize(
    ("angle", "model", "name"), [(angle, *curve_keys) for angle, curve_keys in sorted(FINE_CURVES.items())]
)
def test_bands_equal_exact_angles_within_the_tolerance(angle, model, name, many_lights):
    """Light moves along the curve by at most the tolerance of the linear approximation.

    The light below each band edge lies between the reference below the edge minus and plus the tolerance. The angles of
    Ashikhmin and Shirley, and tilts, have a crease through their pole: twice the tolerance there.
    """
    lights = many_lights
    receivers = ref.only_above(ref.make_random_receivers(5, lights.num_lights, seed=2), lights)
    term, num_bands = TERMS[model], TERMS[model].curve(name).num_bands
    ones = {c.name: np.ones((3, c.num_bands)) for c in term.curves}
    transport = project(model, ones, name, lights, receivers)[..., 0]
    edges = np.arange(1, num_bands)
    tolerance = (TOLERANCE_BANDS + TOLERANCE_SHARE * edges) * (2 if angle in CREASED else 1)
    divided = ref.pieces(lights, 4)
    for row in range(len(transport)):
        power, fractions, wi, wo = ref.shade_pieces(term, lights, receivers, row, divided)
        gamma = angles_numpy(angle, wi, np.broadcast_to(wo, wi.shape), term.curve(name).axes).ravel() * (
            num_bands / (np.pi / 2)
        )
        order = np.argsort(gamma)
        below = np.concatenate([[0], np.cumsum((power[:, :1] * fractions).ravel()[order])])
        below, total = below / below[-1], below[-1]
        reached = np.cumsum(transport[row])[:-1] / total
        low, high = (below[np.searchsorted(gamma[order], edges + way * tolerance)] for way in (-1, 1))
        # of all light: pieces of the reference are finite, fractions follow chords, and subdivision ends at a pole
        slack = 6e-3 if angle in CREASED else 2e-3
        assert (low - slack <= reached).all()
        assert (reached <= high + slack).all()


SMOOTH = [
    ({"model": "lambert", "params": {}}, 0.01),
    ({"model": "blinn_phong", "params": {"exponent": 10.0}}, 0.02),
    ({"model": "cook_torrance", "params": {"sigma": 0.5}}, 0.02),
    ({"model": "ggx", "params": {"roughness": 0.7}}, 0.02),
    ({"model": "ashikhmin_shirley", "params": {"nu": 5.0, "nv": 12.0}}, 0.02),
    ({"model": "oren_nayar", "params": {"sigma": 0.5}}, 0.01),
    ({"model": "phong", "params": {"exponent": 5.0}}, 0.02),
    ({"model": "lafortune", "params": {"exponent": 5.0, "c_x": -0.8, "c_y": -0.5}}, 0.02),
    ({"model": "ward", "params": {"alpha": 0.5}}, 0.02),
    ({"model": "ward_duer", "params": {"alpha": 0.5}}, 0.02),
    ({"model": "ward_anisotropic", "params": {"alpha_x": 0.7, "alpha_y": 0.4}}, 0.02),
    ({"model": "schlick", "params": {"roughness": 0.3}}, 0.02),
    ({"model": "beard_maxwell", "params": {"sigma": 0.5}}, 0.02),
]


@pytest.fixture(scope="module")
def texels_and_triangles():
    """An environment and its triangles."""
    radiance = studio(48)
    return radiance, tessellate_environment(radiance, 1000)


@pytest.mark.parametrize(("document", "bound"), SMOOTH, ids=lambda v: v["model"] if isinstance(v, dict) else None)
def test_triangles_represent_all_texels(document, bound, texels_and_triangles):
    """Against the reflection integral over every texel, by brute force."""
    radiance, lights = texels_and_triangles
    receivers = ref.only_above(ref.make_random_receivers(60, lights.num_lights, seed=4, horizon=0.3), lights)
    term = TERMS[document["model"]].normalized(document)
    bands = {curve.name: curve_bands(document, curve) for curve in term.curves}
    projected = Projector(term, contract(term, bands, None), lights, receivers).project(0, 60)[:, 0]
    exact = ref.integrate_texels(document, radiance, receivers)
    assert np.sqrt(np.mean((projected - exact) ** 2) / np.mean(exact**2)) < bound


def test_extreme_directions_stay_finite(lights):
    """View directions at the horizon, at normal incidence, opposite to a light: no band is infinite or negative."""
    normal = np.tile(np.float32([0, 1, 0]), (4, 1))
    wo = np.float32([[1, 0, 0], [0, 1, 0], -lights.direction[0], [np.sqrt(1 - 1e-12), 1e-6, 0]])
    tangent = np.tile(np.float32([1, 0, 0]), (4, 1))
    visible = np.full((4, (lights.num_lights + 7) // 8), 255, np.uint8)
    receivers = ref.only_above(ref.make_receivers_at_origin(wo, normal, tangent, visible), lights)
    for model, name in CURVES:
        transport = project(model, default_bands(model), name, lights, receivers)
        assert np.isfinite(transport).all()
        assert transport.min() >= -1e-6 * max(transport.max(), 1e-6)
