"""Arrays for the browser: number of basis functions per table, half-precision coefficients, texture sizes."""

import itertools

import numpy as np
import pytest

from relume.live.free_camera.basis.material_tables import build_tables, needed_degrees
from relume.live.free_camera.browser import geometry_arrays, material_arrays
from relume.live.free_camera.frame import MaterialState
from relume.math.zernike import DEGREE, DEGREES, FAST_DEGREE, NUM_FUNCTIONS, num_functions
from relume.probes.triangle_grids import ProbeGrid, node_index, num_nodes
from relume.raytrace.surface_textures import Textures

SEED = 11
LAMBERT = {"model": "lambert", "color": [0.5, 0.4, 0.3], "params": {}, "curves": {}, "texture": None}
GLOSSY = {**LAMBERT, "model": "blinn_phong", "params": {"exponent": 20.0}}


def degrees_of(term: dict[str, object]) -> int:
    return int(build_tables([[term]]).degree.max())


def test_a_diffuse_table_needs_one_function_and_a_shiny_one_all() -> None:
    assert degrees_of(LAMBERT) == 0
    assert degrees_of(GLOSSY) == DEGREE


def test_degrees_below_the_bound_are_omitted() -> None:
    table = np.zeros((2, 4, 3, NUM_FUNCTIONS), np.float32)
    table[:, ..., 0] = 1
    table[0, ..., NUM_FUNCTIONS - 1] = 0.5e-3
    table[1, ..., NUM_FUNCTIONS - 1] = 2e-3
    assert needed_degrees(table, DEGREES).tolist() == [0, DEGREE]


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e9])
@pytest.mark.parametrize("num", [1, 15, NUM_FUNCTIONS])
def test_coefficients_of_any_size_survive_half_precision(size: float, num: int) -> None:
    coefficients = np.random.default_rng(SEED).normal(0, size, (50, 3, NUM_FUNCTIONS)).astype(np.float32)
    outgoing = material_arrays._vector_arrays("vectors/4", coefficients, num)
    scale, factor = outgoing["vectors/4/scale"][0]
    assert factor == num
    numbers = outgoing["vectors/4"].astype(np.float64).reshape(50, -1)
    assert numbers.shape[1] - 3 * num in range(4)  # whole texels
    decoded = numbers[:, : 3 * num].reshape(50, 3, num) * float(scale)
    assert np.abs(decoded - coefficients[:, :, :num]).max() <= 1e-3 * np.abs(coefficients).max()


def test_materials_get_their_basis_functions() -> None:
    bump, narrow = np.array([False, True, False, False]), {**LAMBERT, "model": "ggx", "params": {"alpha": 0.02}}
    materials = MaterialState.from_terms([[LAMBERT], [LAMBERT], [LAMBERT, GLOSSY], [narrow]])
    total, others = material_arrays.needed_function_counts(materials, bump)
    assert total.tolist() == [1, NUM_FUNCTIONS, NUM_FUNCTIONS, 0]
    assert others.tolist() == [0, 0, NUM_FUNCTIONS, NUM_FUNCTIONS]
    degree = materials.tables.degree.copy()
    degree[0, 0] = 2
    materials = materials._replace(tables=materials.tables._replace(degree=degree))
    total, _ = material_arrays.needed_function_counts(materials, bump)
    assert total.tolist() == [num_functions(FAST_DEGREE), NUM_FUNCTIONS, NUM_FUNCTIONS, 0]


def test_slots_are_the_nodes_of_the_lattice() -> None:
    rows = np.array([[1, 3], [0, 2], [1, 0], [0, 0]], np.uint8)
    counts = num_nodes(rows).ravel()
    first = (np.cumsum(counts) - counts).reshape(rows.shape).astype(np.uint32)
    node = np.random.default_rng(SEED).integers(0, 9, int(counts.sum())).astype(np.uint32)
    slots = geometry_arrays.node_arrays(ProbeGrid(rows, first, node))
    narrow = node[[0, 1, 2, *(first[2, 0] + np.arange(3))]]
    assert len(slots.lattice_node) == 10 + 6 + len(np.unique(narrow))
    for face, side in np.argwhere(rows > 0):
        r, own, begin = int(rows[face, side]), slots.sides[face, side], int(first[face, side])
        assert own[3] == r
        for i, j in itertools.product(range(r + 1), repeat=2):
            if i + j > r:
                continue
            slot = own[0] + node_index(r, i, j) if r > 1 else own[[0, 2, 1][node_index(r, i, j)]]
            assert slots.lattice_node[slot] == node[begin + node_index(r, i, j)]
    assert (slots.sides[1, 0] == slots.sides[1, 1]).all()  # a side without nodes has those of the other
    assert (slots.sides[2, 1] == slots.sides[2, 0]).all()
    assert not slots.sides[3].any()


def test_the_finest_level_of_the_largest_texture_is_dropped_first(monkeypatch: pytest.MonkeyPatch) -> None:
    sides = [(8, 4, 2, 1), (4, 2, 1)]
    levels, first, end = [], [0], 0
    for texture in sides:
        for side in texture:
            levels.append((end, side, side))
            end += side * side
        first.append(len(levels))
    texels = np.zeros((end, 3), np.float32)
    textures = Textures(
        texels, np.array(levels), np.array(first), np.zeros((2, 2), np.int64), np.zeros((1, 3), np.int64)
    )
    selected, begins = geometry_arrays._select_levels(textures)
    assert selected.tolist() == [0, 1, 2, 3, 4, 5, 6]
    monkeypatch.setattr(geometry_arrays, "MAX_TEXELS", 50)
    selected, begins = geometry_arrays._select_levels(textures)
    assert (selected.tolist(), begins.tolist()) == ([1, 2, 3, 4, 5, 6], [0, 3, 6])
