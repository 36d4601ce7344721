"""Light between cells as a moving hand sees it, against what is exact."""

import numpy as np
import pytest
import twins
from sessions import relative_rmse

from relume.basis.zernike import SENT_DEGREE
from relume.brdf.albedo import reflectances_of
from relume.light.gather_rays import cosine_ray, make_pattern, small_shifts_of
from relume.light.triangles import subdivide
from relume.methods.cells.between import Leaving, quickly_between, sent_between
from relume.methods.cells.cell_light import CellLight
from relume.methods.cells.quick import arriving_quickly
from relume.methods.cells.reflecting import Arrived
from relume.project.sent import NUM_SENT, grid_means, square_of
from relume.project.squares import coming_squares, leaving_squares
from relume.trace.cell_tree import NO_CELL
from relume.trace.cells import gather_samples_of

NUM_CELLS = 60
PLAIN = {"texture": None, "params": {}, "curves": {}}
MATT = reflectances_of([{**PLAIN, "model": "lambert", "color": [0.5, 0.4, 0.3]}])
SHINY = reflectances_of([{**PLAIN, "model": "blinn_phong", "color": [0.4, 0.3, 0.5], "params": {"exponent": 20.0}}])


@pytest.fixture(scope="module")
def cells():
    """Flat ones, whose rays hit each other anywhere; a tenth hits nothing."""
    rng = np.random.default_rng(4)
    normal = np.repeat(twins.unit(rng.normal(size=(NUM_CELLS, 1, 3))), 4, axis=1).astype(np.float32)
    visible = rng.integers(0, 256, (NUM_CELLS, 4, 5)).astype(np.uint8)
    links = rng.integers(0, NUM_CELLS, (NUM_CELLS, 4 * 55)).astype(np.uint16)
    links[rng.random(links.shape) < 0.1] = NO_CELL
    material, white = np.arange(NUM_CELLS).astype(np.uint16) % 2, np.ones((2, NUM_CELLS, 3), np.float32)
    return CellLight(gather_samples_of(normal, normal), visible, links, make_pattern(55, 0, 9), material, white)


@pytest.fixture(scope="module")
def arrived(cells):
    lights = subdivide(np.random.default_rng(3).random((16, 32, 3), np.float32), 40)
    return Arrived(cells.irradiance(lights), cells.vectors(np.arange(1, NUM_CELLS, 2), lights, SENT_DEGREE))


def test_squares_are_those_of_the_rays(cells):
    points, links, pattern, frames = cells.points, cells.links.reshape(-1, 55), cells.pattern, cells.frames
    leaving = leaving_squares(points, links, pattern, frames)
    coming = coming_squares(points, 4, pattern, frames)
    for p in (0, 7, 100):
        shift = small_shifts_of(pattern, points.seed[p])[0]
        n, t = points.normal[p], points.tangent[p]
        for ray in range(55):
            away = np.array(cosine_ray(pattern.rays[ray], shift)) @ np.array([t, np.cross(n, t), n])
            assert coming[p, ray] == square_of(frames, p // 4, *away.astype(np.float32))
            cell = links[p, ray]
            assert leaving[p, ray] == (0 if cell == NO_CELL else square_of(frames, cell, *-away.astype(np.float32)))


def test_what_arrives_quickly_is_what_arrives_in_squares(cells, arrived):
    reflecting = cells.reflecting((MATT, SHINY))
    even, vectors = reflecting.sent(arrived)
    now = Leaving(even, reflecting.rows, vectors, reflecting.widening).sent(cells)
    exact, quick = cells.arriving(now, reflecting.rows), arriving_quickly(cells, now, reflecting.rows)
    np.testing.assert_allclose(quick.irradiance, exact.irradiance, rtol=1e-4)
    assert relative_rmse(quick.vectors[..., :6], exact.vectors[..., :6]) < 0.05
    in_squares, lobe = np.zeros((30, 3, NUM_SENT)), now.lobe[cells.links]
    light = now.even[cells.links].astype(float)
    light += np.where(lobe[..., None] >= 0, now.scale[lobe] * now.table[lobe, cells.leaving], 0)
    for row, cell in enumerate(reflecting.rows):
        in_squares[row] = np.pi / 220 * light[cell].T @ grid_means().T[cells.coming[cell]]
    np.testing.assert_allclose(quick.vectors, in_squares, atol=1e-5)


@pytest.mark.parametrize(("first", "last"), [(1, 1), (1, 24), (2, 2), (3, 5)])
@pytest.mark.parametrize("wall", [MATT, SHINY])
def test_what_is_sent_quickly_is_about_what_is_sent(cells, arrived, wall, first, last):
    reflecting = cells.reflecting((MATT, wall))
    known = Arrived(arrived.irradiance, arrived.vectors[: len(reflecting.rows)])
    exact, quick = (of(cells, reflecting, known, first, last) for of in (sent_between, quickly_between))
    assert relative_rmse(quick.even, exact.even) < 0.03
    assert np.linalg.norm(quick.vectors - exact.vectors) <= 0.05 * np.linalg.norm(exact.vectors)


def test_a_difference_knows_the_rows_of_both():
    rng = np.random.default_rng(1)
    even, vectors = rng.random((2, 5, 3)).astype(np.float32), rng.random((2, 2, 3, NUM_SENT)).astype(np.float32)
    falls = np.array([[0.1, 0.2], [0.3, 0.4]], np.float32)
    one, other = (Leaving(even[k], np.array(rows), vectors[k], falls[k]) for k, rows in enumerate(([0, 3], [3, 4])))
    found = one.less(other)
    np.testing.assert_array_equal(found.even, even[0] - even[1])
    np.testing.assert_array_equal(found.rows, [0, 3, 4])
    np.testing.assert_array_equal(found.widening, [falls[0, 0], falls[0, 1], falls[1, 1]])
    np.testing.assert_array_equal(found.vectors, [vectors[0, 0], vectors[0, 1] - vectors[1, 0], -vectors[1, 1]])
