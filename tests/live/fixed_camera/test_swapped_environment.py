"""Pictures under another environment than the one that was baked."""

from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest
from environment_files import dusk, write_map
from session_edits import BUDGET, make_look, relative_rmse, run_until_exact
from tiny_scenes import still_life

from relume.assets.environments.environment_store import STORE, store_environment
from relume.core.cache import Cache
from relume.core.errors import NotFoundError
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.look import default_look, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.reference import reference_image
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (48, 36)


def scene_under(radiance):
    """The still life in another environment."""
    scene = still_life()
    light = replace(scene.environment, radiance=radiance)
    return make_scene("other", scene.meshes, scene.materials, scene.cameras, light)


def baked(scene, folder, relightable=False):
    recipe = Recipe("direct", ("front",), SIZE, 1000, relightable)
    return open_transfer(bake_in_process(METHODS["direct"], scene, recipe, folder), Cache(1 << 30))


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return baked(still_life(), tmp_path_factory.mktemp("plain") / "store.zarr")


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    with STORE.with_search_folder(tmp_path_factory.mktemp("library")) as folder:
        yield folder


@pytest.fixture(scope="module")
def map_name(library, tmp_path_factory):
    return store_environment(library, write_map(tmp_path_factory.mktemp("maps") / "dusk.exr", dusk()), "Dusk").reference


def under(name, **more):
    def change(document):
        document["environment"].update(map=name, **more)

    return change


def test_a_swap_is_reweighted_and_swapping_back_restores_the_picture(plain, map_name):
    picture = run_until_exact(Picture(plain, "front", Cache(BUDGET)))
    before = picture.image()
    look = make_look(plain, under(map_name, rotation=30.0, intensity=2.0))
    picture.set_look(look)
    assert picture.next_job().state == "shading"
    swapped = run_until_exact(picture).image()
    assert relative_rmse(swapped, ref.full_evaluation(plain, "front", look)) < 1e-6
    assert relative_rmse(swapped, before) > 0.3
    picture.set_look(make_look(plain))
    np.testing.assert_allclose(run_until_exact(picture).image(), before, rtol=1e-5, atol=1e-6)


def test_curves_follow_in_a_swapped_environment(plain, map_name):
    def edit(document):
        under(map_name)(document)
        document["materials"]["Ball"]["terms"][1]["params"]["sigma"] = 0.35

    picture = run_until_exact(Picture(plain, "front", Cache(BUDGET)))
    picture.set_look(make_look(plain, under(map_name)))
    run_until_exact(picture).prepare("/materials/Ball/terms/1/curves/theta_h")
    run_until_exact(picture).set_look(make_look(plain, edit))
    assert picture.next_job() is None
    assert picture.advance(None).exact
    assert relative_rmse(picture.image(), ref.full_evaluation(plain, "front", make_look(plain, edit))) < 1e-5


def test_the_scenes_own_map_from_the_library_changes_nothing(plain, library, tmp_path):
    own = store_environment(library, write_map(tmp_path / "own.exr", still_life().environment.radiance), "Own")
    images = [render_image(plain, "front", make_look(plain, under(name))) for name in (None, own.reference)]
    assert relative_rmse(images[1], images[0]) < 1e-5


def test_a_bake_in_another_environment_is_near_a_fresh_one(plain, map_name, tmp_path):
    fresh = baked(scene_under(dusk()), tmp_path / "fresh.zarr")
    expected = render_image(fresh, "front", make_look(fresh))
    # 0.0005; without new tiles 0.03
    assert relative_rmse(render_image(plain, "front", make_look(plain, under(map_name))), expected) < 0.002
    relightable = baked(still_life(), tmp_path / "relightable.zarr", relightable=True)
    own = [render_image(transfer, "front", make_look(transfer)) for transfer in (relightable, plain)]
    assert relative_rmse(*own) < 0.01
    other = render_image(relightable, "front", make_look(relightable, under(map_name)))
    assert relative_rmse(other, expected) < 0.02


def test_the_reference_uses_the_swapped_map(map_name):
    look = validate({"environment": {"map": map_name, "rotation": 40.0}}, default_look(still_life().materials))
    own = validate({"environment": {"rotation": 40.0}}, default_look(still_life().materials))
    swapped = reference_image(still_life(), "front", look, SIZE, 50)
    np.testing.assert_array_equal(swapped, reference_image(scene_under(dusk()), "front", own, SIZE, 50))


def test_a_missing_map_is_rejected_and_the_picture_stays(plain, map_name):
    picture = run_until_exact(Picture(plain, "front", Cache(BUDGET)))
    look = make_look(plain, under(map_name))
    gone = look.model_copy(update={"environment": look.environment.model_copy(update={"map": "env:" + 16 * "0"})})
    with pytest.raises(NotFoundError, match="import its file again"):
        picture.set_look(gone)
    assert picture.next_job() is None
    picture.set_look(make_look(plain))
    assert picture.advance(None).exact


def test_looks_of_stores_without_maps_are_completed(plain):
    old = {**plain.default_look, "environment": {"intensity": 1.0, "color": [1.0, 1.0, 1.0], "rotation": 0.0}}
    assert validate({}, old).environment.map is None
    assert validate({"environment": {"map": "sunset"}}, old).environment.map == "sunset"
