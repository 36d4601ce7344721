"""The hemispherical basis: orthonormal, nested, and the kernel for incident radiance coefficients."""

import numba as nb
import numpy as np
import pytest
from hemisphere_quadrature import hemisphere
from numpy.typing import NDArray

from relume.lights.spherical_triangles import TriangleLights
from relume.math.zernike import DEGREE, NUM_FUNCTIONS, basis_functions, num_functions, recurrence
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.transport.incident_coefficients import F64, incident_coefficients


def incident_coefficients_numpy(points: SurfacePoints, visible: NDArray[np.uint8], lights: TriangleLights) -> F64:
    """Reference of `incident_coefficients` for light triangles only, in plain NumPy.

    Args:
        points, visible, lights: as there.
    Returns:
        (n, 3, K) float64
    """
    n, t = points.normal.astype(np.float64), points.tangent.astype(np.float64)
    frame = np.stack([t, np.cross(n, t), n], axis=1)
    wi = np.einsum("nij,mj->nmi", frame, lights.direction.astype(np.float64))
    is_visible = np.unpackbits(visible, axis=1, count=lights.num_lights, bitorder="little").astype(np.float64)
    weight = is_visible * np.maximum(wi[..., 2], 0)
    return np.asarray(np.einsum("nm,mc,nmk->nck", weight, lights.irradiance.astype(np.float64), basis_functions(wi)))


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", inline="always")
def evaluate_basis_along(table, x, y, out):  # type: ignore[no-untyped-def]
    """Evaluate all functions in one direction; rows of one ray would be written and read at every index.

    Args:
        table: the `recurrence`. x, y: of the direction, local, unit. out: written. (K,) float32
    """
    argument = np.float32(2) * (x * x + y * y) - np.float32(1)
    re, im = np.float32(1), np.float32(0)
    before, last = np.float32(0), np.float32(1)
    for row in range(table.order.shape[0]):
        a = table.a[row]
        if a == 0:
            if table.order[row] > 0:
                re, im = re * x - im * y, re * y + im * x
            before, last = np.float32(0), np.float32(1)
        else:
            before, last = last, (a * argument + table.b[row]) * last - table.c[row] * before
        value = table.norm[row] * last
        out[table.sine[row]] = value * im
        out[table.cosine[row]] = value * re


def test_functions_are_orthonormal_under_the_cosine():
    wi, weight = hemisphere()
    assert weight.sum() == pytest.approx(np.pi)  # of a white environment
    functions = basis_functions(wi)
    np.testing.assert_allclose(np.einsum("nk,nl,n->kl", functions, functions, weight), np.eye(NUM_FUNCTIONS), atol=1e-6)


def test_functions_are_sorted_by_polynomial_degree():
    """A prefix of the functions is the basis of a lower degree: x^a y^b lies in it if a + b is at most that degree."""
    wi, weight = hemisphere()
    functions = basis_functions(wi)
    for degree in range(DEGREE + 1):
        monomial = wi[:, 0] ** degree
        fraction = np.einsum("n,nk,n->k", monomial, functions, weight)
        np.testing.assert_allclose(fraction[num_functions(degree) :], 0, atol=1e-6)
        assert np.abs(fraction[num_functions(degree - 1) :]).max() > 1e-3


def test_light_below_the_horizon_contributes_nothing():
    assert not basis_functions(np.array([[0.0, 0.6, -0.8], [0, 0, -1]])).any()


def test_every_function_has_one_table_entry():
    table = recurrence()
    places = [*table.cosine, *table.sine[table.order > 0]]
    assert sorted(places) == list(range(NUM_FUNCTIONS))


@pytest.fixture
def scattered():
    """Points and lights in random directions, more than one batch, with random bits."""
    rng = np.random.default_rng(5)
    normal, direction = (rng.normal(size=(num, 3)).astype(np.float32) for num in (40, 300))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    points = SurfacePoints(normal, normal, any_tangent(normal), np.zeros(40, np.uint32))
    lights = TriangleLights(np.zeros((3, 6, 300), np.float32), direction, rng.random((300, 3), np.float32))
    return points, rng.integers(0, 256, (40, 38), dtype=np.uint8), lights


def test_incident_coefficients_equal_their_reference(scattered):
    points, visible, lights = scattered
    actual, expected = (
        incident_coefficients(points, visible, lights, ()),
        incident_coefficients_numpy(points, visible, lights),
    )
    assert np.abs(actual - expected).max() < 1e-5 * np.abs(expected).max()


def test_the_first_coefficient_is_the_irradiance(scattered):
    points, visible, lights = scattered
    cosine = np.maximum(points.normal.astype(np.float64) @ lights.direction.astype(np.float64).T, 0)
    is_visible = np.unpackbits(visible, axis=1, count=300, bitorder="little")
    irradiance = (is_visible * cosine) @ lights.irradiance
    np.testing.assert_allclose(
        np.sqrt(np.pi) * incident_coefficients(points, visible, lights, ())[..., 0], irradiance, rtol=1e-4, atol=1e-4
    )


def test_functions_in_one_direction_equal_all_functions():
    wi, _ = hemisphere(6, 8)

    @nb.njit
    def along(table, x, y, out):
        evaluate_basis_along(table, x, y, out)

    for direction, expected in zip(wi, basis_functions(wi), strict=True):
        out = np.full(NUM_FUNCTIONS, np.nan, np.float32)
        along(recurrence(), np.float32(direction[0]), np.float32(direction[1]), out)
        np.testing.assert_allclose(out, expected, atol=1e-5)
