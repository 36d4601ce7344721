"""A small picture of every term, in a frame, against the reference over every texel."""

from __future__ import annotations

import pytest
from analytic_terms import ANALYTIC
from session_edits import BUDGET, relative_rmse, run_until_exact
from tiny_scenes import still_life

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.registry import METHODS
from relume.reference import reference_image
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE, NUM_LIGHTS = (32, 24), 1500
# Error of 1,500 triangles with one shadow ray each: shadow edges move by up to a triangle, for all terms alike
# (SHADOWS); a highlight also sees quotient and cosine at one direction for a whole triangle (HIGHLIGHT), and a quotient
# without masking grows towards the horizon, where it changes across the triangle (UNMASKED).
SHADOWS, HIGHLIGHT, UNMASKED = 0.01, 0.02, 0.03
CASES = {
    "lambert": ({}, SHADOWS),
    "oren_nayar": ({"sigma": 0.6}, SHADOWS),
    "phong": ({"exponent": 30.0}, HIGHLIGHT),
    "blinn_phong": ({"exponent": 120.0}, HIGHLIGHT),
    "lafortune": ({"exponent": 20.0, "c_x": -0.9, "c_y": -0.6}, HIGHLIGHT),
    "ward": ({"alpha": 0.2}, HIGHLIGHT),
    "ward_duer": ({"alpha": 0.2}, UNMASKED),
    "ward_anisotropic": ({"alpha_x": 0.15, "alpha_y": 0.4}, HIGHLIGHT),
    "ashikhmin_shirley": ({"nu": 15.0, "nv": 120.0, "f0": 0.4}, HIGHLIGHT),
    "cook_torrance": ({"sigma": 0.2}, HIGHLIGHT),
    "schlick": ({"roughness": 0.05, "f0": 0.4}, UNMASKED),
    "beard_maxwell": ({"sigma": 0.2, "tau": 20.0}, UNMASKED),
    "ggx": ({"roughness": 0.45, "f0": 0.4}, HIGHLIGHT),
    "ggx_multiple": ({"roughness": 0.9, "f0": 0.9}, SHADOWS),
    "sheen": ({"roughness": 0.6}, UNMASKED),
}


def test_every_term_has_a_case() -> None:
    assert set(CASES) == set(ANALYTIC)  # measured ones: tests/assets/measured


@pytest.fixture(scope="module")
def scene():
    return still_life()


@pytest.fixture(scope="module")
def picture(scene, tmp_path_factory):
    recipe = Recipe("direct", ("front",), SIZE, NUM_LIGHTS)
    store = bake_in_process(METHODS["direct"], scene, recipe, tmp_path_factory.mktemp("terms") / "s.zarr")
    transfer = open_transfer(store, Cache(1 << 30))
    return transfer, Picture(transfer, "front", Cache(BUDGET))


@pytest.mark.parametrize("model", CASES)
def test_the_picture_of_a_term_equals_the_reference(model, scene, picture) -> None:
    transfer, live = picture
    params, bound = CASES[model]
    curves = {"theta_o": {"points": [[0, 1.0], [50, 0.8], [90, 0.3]]}} if model != "ggx" else {}
    term = {"model": model, "color": [0.8, 0.5, 0.3], "params": params, "texture": None, "curves": curves}
    look = validate({"materials": {m.name: {"terms": [term]} for m in scene.materials}}, transfer.default_look)
    live.set_look(look)
    image = run_until_exact(live).image()
    assert relative_rmse(image, reference_image(scene, "front", look, SIZE, 0)) < bound
