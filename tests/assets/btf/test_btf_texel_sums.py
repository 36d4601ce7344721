"""Edits of BTFs in fixed views: texels are summed again with cached light, and no preview is reported as exact."""

from dataclasses import replace

import numpy as np
import pytest
from session_edits import kind_of, relative_rmse, run_next_job, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, quad, studio

from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_bake
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume.transport.texture_light import rotated_tables, texture_light_rows

GRAY = {"model": "lambert", "color": [0.5, 0.5, 0.5]}


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    """A floor lit by the studio."""
    ground = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    camera = make_camera("front", [0.3, 1.6, 1.9], [0, 0, 0], 0.5)
    materials = [Material("Floor", (GRAY,)), Material("Other", (GRAY,))]
    wall = quad("wall", [[-1, 0, -1], [1, 0, -1], [1, 1, -1], [-1, 1, -1]], 1)
    scene = make_tiny_scene(ground, wall, camera=camera, environment=studio(32, 20.0), materials=materials)
    recipe, folder = Recipe("direct", ("front",), (64, 48), 300), tmp_path_factory.mktemp("floor")
    return open_bake(bake_in_process(METHODS["direct"], scene, recipe, folder / "direct.zarr"), Cache(1 << 30))


def covered(bake, record, environment=0.0, **params):
    term = {"model": "measured_btf", "data": record.data, "texture": None, "params": params}
    look = {"materials": {"Floor": {"terms": [term]}}, "environment": {"rotation": environment}}
    return validate(look, bake.default_look)


@pytest.fixture
def active_picture(bake, small_btf):
    """A picture with the BTF on the floor, which is being edited; its first image may have come from disk."""
    picture = Picture(bake, "front", Cache(1 << 28), is_watched=True)
    picture.set_look(covered(bake, small_btf.record, scale=2.0))
    run_until_exact(picture).prepare("/materials/Floor/terms/0/params/scale")
    while picture.next_job() is not None:
        run_next_job(picture)
    return picture


@pytest.mark.parametrize("change", [{"scale": 3.0}, {"scale": 2.0, "components": 1}])
def test_texel_sums_follow_an_active_edit_exactly(bake, small_btf, active_picture, change):
    for params in ({"scale": 2.5}, change):
        look = covered(bake, small_btf.record, **params)
        active_picture.set_look(look)
        advance = active_picture.advance(None)
        assert advance.exact
        assert advance.changed
        assert active_picture.next_job() is None
        assert relative_rmse(active_picture.image(), render_image(bake, "front", look)) < 1e-6


def test_a_rotated_texture_is_followed_and_then_exact(bake, small_btf, active_picture):
    before = active_picture.image()
    for degrees in (10.0, 40.0):
        look = covered(bake, small_btf.record, scale=2.0, rotation=degrees)
        active_picture.set_look(look)
        assert active_picture.advance(None).fidelity == "incremental"
        expected = render_image(bake, "front", look)
        assert 1e-4 < relative_rmse(active_picture.image(), expected) < 0.2 * relative_rmse(before, expected)
        assert active_picture.next_job().is_refinement
    assert relative_rmse(run_until_exact(active_picture).image(), expected) < 1e-6


def test_light_missing_from_the_cache_gives_a_preview_that_is_not_exact(bake, small_btf, monkeypatch):
    """As in a look that was opened with images from disk."""
    monkeypatch.setattr("relume.live.fixed_camera.strategies.texel_sum._BUDGET_DIVISOR", 1 << 20)
    picture = Picture(bake, "front", Cache(1 << 28), is_watched=True)
    picture.set_look(covered(bake, small_btf.record, scale=2.0))
    before = run_until_exact(picture).image()
    look = covered(bake, small_btf.record, scale=3.0)
    picture.set_look(look)
    assert picture.advance(None).fidelity == "approximate"
    np.testing.assert_array_equal(picture.image(), before)
    assert kind_of(run_next_job(picture)) == "preview"
    assert picture.advance(None).fidelity == "preview"
    expected = render_image(bake, "front", look)
    assert relative_rmse(picture.image(), expected) < 0.2 * relative_rmse(before, expected)
    assert kind_of(picture.next_job()) == "image"
    assert relative_rmse(run_until_exact(picture).image(), expected) < 1e-6


def test_frames_do_not_wait_for_many_texels(bake, small_btf, active_picture, monkeypatch):
    """They are previewed, and summed with cached light in the background."""
    monkeypatch.setattr("relume.operators.texel_light._MAX_TABLE_ROWS", 0)
    look = covered(bake, small_btf.record, scale=2.9)
    active_picture.set_look(look)
    assert active_picture.advance(None).fidelity == "approximate"
    assert kind_of(run_next_job(active_picture)) == "preview"
    assert active_picture.advance(None).fidelity == "preview"
    assert relative_rmse(run_until_exact(active_picture).image(), render_image(bake, "front", look)) < 1e-6


def test_preparing_an_edit_caches_the_light(bake, small_btf, active_picture):
    """The cache had evicted it."""
    look = covered(bake, small_btf.record, scale=2.0, environment=30.0)
    active_picture.set_look(look)
    run_until_exact(active_picture)
    active_picture._images.cache.trim(0, ())
    active_picture.prepare("/materials/Floor/terms/0/params/scale")
    assert kind_of(run_next_job(active_picture)) == "texel light"
    assert active_picture.next_job() is None
    active_picture.set_look(covered(bake, small_btf.record, scale=3.0, environment=30.0))
    assert active_picture.advance(None).exact


def test_other_fixed_parameters_are_previewed(bake):
    def look(sigma):
        term = {"model": "oren_nayar", "params": {"sigma": sigma}}
        return validate({"materials": {"Floor": {"terms": [term]}}}, bake.default_look)

    picture = Picture(bake, "front", Cache(1 << 28), is_watched=True)
    picture.set_look(look(0.1))
    before = run_until_exact(picture).image()
    picture.set_look(look(1.0))
    assert picture.advance(None).fidelity == "approximate"
    assert kind_of(run_next_job(picture)) == "preview"
    picture.advance(None)
    expected = render_image(bake, "front", look(1.0))
    assert relative_rmse(picture.image(), expected) < 0.3 * relative_rmse(before, expected)
    assert picture.next_job().is_refinement


def test_light_is_rotated_with_the_rings(bake, small_btf):
    """A rotation by 180° permutes the directions of these rings."""
    texels = TERMS["measured_btf"].normalized({"model": "measured_btf", "data": small_btf.record.data}).texels
    light = illumination_from_look(covered(bake, small_btf.record), bake.material_names, has_bounces=False)
    incident = bake.incident_light(bake.samples(bake.views["front"], 0, bake.cache), light)
    half = replace(texels, rotation=np.pi)
    rings = texels.btf.grid
    before, after = (texture_light_rows(level_texels, *incident, 0, 40) for level_texels in (texels, half))
    tables = np.random.default_rng(3).random((5, rings.num_directions), np.float32)
    rotated = np.einsum("tl,ncl->nct", rotated_tables(rings, tables, np.pi), before)
    np.testing.assert_allclose(rotated, np.einsum("tl,ncl->nct", tables, after), rtol=1e-4)
    between = rotated_tables(rings, tables, 0.3)
    np.testing.assert_allclose(between @ np.ones(81), tables.sum(axis=1), rtol=1e-4)  # energy is preserved
