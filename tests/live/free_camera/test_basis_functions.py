"""The number of basis functions of each material: automatic, or chosen in the look."""

import copy
import itertools
from typing import get_args

import numpy as np
import pytest
from probe_shading import rotate_coefficients, shade_probes_numpy
from test_outgoing_coefficients import document
from tiny_scenes import still_life

from relume.core.cache import Cache
from relume.core.errors import ParameterError
from relume.live.free_camera.basis.material_tables import Tables, build_tables
from relume.live.free_camera.basis.outgoing_coefficients import outgoing_coefficients
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.shade_probes import shade_probes
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.look.model import BasisFunctions
from relume.math.zernike import (
    DEGREE,
    DEGREES,
    NUM_FUNCTIONS,
    degree_of,
    num_functions,
    num_rows,
    recurrence_by_degree,
)
from relume.methods.registry import METHODS
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

LAMBERT = document("lambert", color=[0.5, 0.4, 0.3])
SMOOTH = document("phong", params={"exponent": 3.0})
GLOSSY = document("blinn_phong", color=[0.2, 0.1, 0.3], params={"exponent": 20.0})
BRUSHED = document("ward_anisotropic", params={"alpha_x": 0.45, "alpha_y": 0.3})
SIZE = (48, 36)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    recipe = Recipe("probes", ("front",), SIZE, 60, num_probes=800)
    folder = tmp_path_factory.mktemp("functions")
    return open_bake(bake_in_process(METHODS["probes"], still_life(), recipe, folder / "s.zarr"), Cache(1 << 30))


def test_functions_up_to_a_degree_are_a_prefix():
    rows = recurrence_by_degree()
    for degree in range(DEGREE + 1):
        first = np.concatenate([rows.cosine[: num_rows(degree)], rows.sine[: num_rows(degree)]])
        assert set(first.tolist()) == set(range(num_functions(degree)))
        last = num_functions(degree + 1) - 1
        assert {degree_of(k) for k in range(num_functions(degree), last + 1)} == {degree}
    assert get_args(BasisFunctions) == tuple(num_functions(degree) for degree in range(DEGREE + 1))


def test_a_material_has_the_functions_that_its_terms_need():
    tables = build_tables([[LAMBERT], [SMOOTH], [LAMBERT, GLOSSY], [BRUSHED], []])
    assert tables.degree[0].tolist() == [0, -1, -1]
    assert 1 < tables.degree[1, 0] <= DEGREE
    assert tables.degree[2].tolist() == [0, DEGREE, DEGREE]
    assert tables.degree[3].max() == DEGREE
    assert tables.degree[4].tolist() == [-1, -1, -1]
    joined = Tables.joined([tables, build_tables([[GLOSSY]], [2])])
    assert joined.degree.tolist() == [*tables.degree.tolist(), [2, -1, -1]]


def shade(bake, tables, vectors, others):
    num = bake.stored_scene.probes.num_points
    viewed = bake.stored_scene.viewed_from(np.array([0.3, 1.2, 2.0], np.float32), np.ones(num, np.uint8))
    return viewed, shade_probes(viewed, vectors, others, tables)


def random_light(bake, seed):
    shape = bake.stored_scene.probes.num_points, 3, NUM_FUNCTIONS
    return np.random.default_rng(seed).normal(size=(2, *shape)).astype(np.float32)


@pytest.mark.parametrize("terms", [[LAMBERT], [SMOOTH], [LAMBERT, GLOSSY], [BRUSHED]])
def test_automatic_degrees_omit_less_than_a_thousandth(bake, terms):
    tables = build_tables([terms] * len(bake.material_names))
    vectors, others = random_light(bake, 3)
    viewed, actual = shade(bake, tables, vectors, others)
    for probe in range(0, len(vectors), len(vectors) // 40):
        args = bake.stored_scene, vectors, others, tables, viewed.camera_position, probe
        for values, expected in zip(actual, shade_probes_numpy(*args), strict=True):
            np.testing.assert_allclose(values[probe], expected, atol=5e-3 * max(1.0, np.abs(expected).max()))


def test_light_beyond_the_degree_of_a_material_is_not_read(bake):
    """Functions that a material does not need could hold anything."""
    vectors, others = random_light(bake, 4)
    names = len(bake.material_names)
    for tables in (build_tables([[LAMBERT]] * names), build_tables([[GLOSSY]] * names, [3] * names)):
        _, before = shade(bake, tables, vectors, others)
        spoiled = vectors.copy()
        spoiled[..., num_functions(int(tables.degree.max())) :] = 1e30
        _, after = shade(bake, tables, spoiled, others)
        np.testing.assert_array_equal(before.radiance, after.radiance)
        assert before.radiance.any()


@pytest.mark.parametrize(("term", "degree"), [*itertools.product([GLOSSY, BRUSHED], [0, 1, 4, 7])])
def test_a_chosen_degree_is_the_plain_sum_up_to_it(bake, term, degree):
    """Σ_k p_k t_k of all light, against the coefficients themselves."""
    names = len(bake.material_names)
    tables = build_tables([[term]] * names, [degree] * names)
    assert (tables.degree == [degree, -1, -1]).all()
    vectors, others = random_light(bake, 5)
    viewed, actual = shade(bake, tables, vectors, others)
    assert not actual.environment.any()
    kept = np.where(degree >= DEGREES, 1.0, 0.0)
    for probe in range(0, len(vectors), len(vectors) // 20):
        args = bake.stored_scene, vectors * kept, others, tables, viewed.camera_position, probe
        expected, _ = shade_probes_numpy(*args)
        np.testing.assert_allclose(actual.radiance[probe], expected, atol=1e-4 * max(1.0, np.abs(expected).max()))
    if term is GLOSSY:  # straight down the normal, without interpolation
        table = outgoing_coefficients(term).table[0, 0] * kept
        assert np.allclose(rotate_coefficients(tables_row(tables), 0.0), table, atol=1e-6)


def tables_row(tables):
    """The first row of a look's first table, by function. (3, K)"""
    out = np.zeros((3, NUM_FUNCTIONS))
    out[:, recurrence_by_degree().cosine] = tables.isotropic[tables.table_index[0, 0, 0], 0]
    return out


def picture_of(bake, change):
    look = copy.deepcopy(complete({}, bake.default_look))
    change(look)
    picture = FreeCameraPicture(bake, "front")
    picture.set_look(validate(look, bake.default_look))
    picture.advance(None)
    return picture.image()


def test_pictures_show_the_chosen_number(bake):
    def change(count):
        def edit(look):
            for material in look["materials"].values():
                material.update(terms=[GLOSSY], **({} if count is None else {"basis_functions": count}))

        return edit

    images = {count: picture_of(bake, change(count)) for count in (None, 1, 6, 36)}
    for image in images.values():
        assert np.isfinite(image).all()
    for first, second in itertools.combinations(images.values(), 2):
        assert np.abs(first - second).max() > 0.01 * np.abs(first).max()
    away = [np.abs(images[count] - images[None]).mean() for count in (1, 6, 36)]
    assert away == sorted(away, reverse=True)


def test_the_number_is_part_of_the_look_and_checked(bake):
    name, default = bake.material_names[0], bake.default_look

    def look_with(count):
        return complete({"materials": {name: {"basis_functions": count}}}, default)

    assert look_with(6)["materials"][name]["basis_functions"] == 6
    assert validate(look_with(6), default).materials[name].basis_functions == 6
    assert "basis_functions" not in look_with(None)["materials"][name]
    for bad in (0, 12, 75, -1, 6.5, True, "6", [6], {"a": 1}, float("nan"), 10**400):
        with pytest.raises(ParameterError, match="basis_functions"):
            look_with(bad)
