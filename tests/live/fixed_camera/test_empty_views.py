"""Views without light or visible materials are black, and recover."""

from __future__ import annotations

import numpy as np
import numpy_reference as ref
from picture_edits import BALL, find_pure_ball_pixels, open_exact_picture
from session_edits import make_look, relative_rmse, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, sphere

from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.methods.registry import METHODS
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process


def test_no_light_is_black(transfer):
    def dark(document):
        document["environment"]["intensity"] = 0.0

    picture = open_exact_picture(transfer, BALL + "theta_h")
    picture.set_look(make_look(transfer, dark))
    assert not run_until_exact(picture).image().any()
    picture.set_look(make_look(transfer))
    assert (
        relative_rmse(run_until_exact(picture).image(), ref.full_evaluation(transfer, "front", make_look(transfer)))
        < 1e-6
    )


def test_black_environment_is_black_in_every_pixel_and_stays_so(tmp_path):
    scene = make_tiny_scene(
        sphere("ball", [0, 0, 0], 1, 0, num_rings=6),
        camera=make_camera("c", [0, 0, 4], [0, 0, 0], 0.8),
        environment=np.zeros((8, 16, 3), np.float32),
    )
    bake_in_process(METHODS["direct"], scene, Recipe("direct", ("c",), (32, 24), 50), tmp_path / "s.zarr")
    transfer = open_transfer(tmp_path / "s.zarr", Cache(1 << 30))
    pointer = "/materials/M0/terms/0/curves/theta_i"
    picture = open_exact_picture(transfer, pointer, view="c")
    assert not picture.image().any()
    assert not picture.highlight_pixels(pointer, 0, 90).any()

    def brighter(document):
        document["materials"]["M0"]["terms"][0]["curves"] = {"theta_i": {"points": [[0, 5], [90, 0]]}}

    picture.set_look(make_look(transfer, brighter))
    assert not run_until_exact(picture).image().any()


def test_a_material_without_terms_or_with_zero_curves_is_black(transfer):
    def nothing(document):
        document["materials"]["Ball"]["terms"] = []

    def zero(document):
        for term in document["materials"]["Ball"]["terms"]:
            term["curves"] = {c.name: {"points": [[0, 0], [90, 0]]} for c in TERMS[term["model"]].curves}

    alone = find_pure_ball_pixels(transfer)
    picture = open_exact_picture(transfer)
    for change in (nothing, zero, nothing):
        picture.set_look(make_look(transfer, change))
        image = run_until_exact(picture).image()
        assert not image[alone].any()
        assert image[~alone].any()
    picture.set_look(make_look(transfer))
    assert (
        relative_rmse(run_until_exact(picture).image(), ref.full_evaluation(transfer, "front", make_look(transfer)))
        < 1e-6
    )
