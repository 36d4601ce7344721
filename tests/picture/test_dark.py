"""Where there is nothing to see the picture is black, and comes back."""

from __future__ import annotations

import numpy as np
import twins
from pictures import BALL, opened, pixels_of_ball_alone
from sessions import look_of, relative_rmse, settle
from tiny_scenes import looking, scene_of, sphere

from relume.bake import Recipe
from relume.brdf.registry import TERMS
from relume.memory import Memory
from relume.methods.registry import METHODS, open_transfer
from relume.store import bake_here


def test_no_light_is_black(transfer):
    def dark(document):
        document["environment"]["scale"] = 0.0

    picture = opened(transfer, BALL + "theta_h")
    picture.set_look(look_of(transfer, dark))
    assert not settle(picture).image().any()
    picture.set_look(look_of(transfer))
    assert relative_rmse(settle(picture).image(), twins.full_evaluation(transfer, "front", look_of(transfer))) < 1e-6


def test_black_environment_is_black_in_every_pixel_and_stays_so(tmp_path):
    scene = scene_of(
        sphere("ball", [0, 0, 0], 1, 0, rings=6),
        camera=looking("c", [0, 0, 4], [0, 0, 0], 0.8),
        environment=np.zeros((8, 16, 3), np.float32),
    )
    bake_here(METHODS["direct"], scene, Recipe("direct", ("c",), (32, 24), 50), tmp_path / "s.zarr")
    transfer = open_transfer(tmp_path / "s.zarr", Memory(1 << 30))
    pointer = "/materials/M0/terms/0/curves/theta_i"
    picture = opened(transfer, pointer, view="c")
    assert not picture.image().any()
    assert not picture.brush(pointer, 0, 90).any()

    def brighter(document):
        document["materials"]["M0"]["terms"][0]["curves"] = {"theta_i": {"points": [[0, 5], [90, 0]]}}

    picture.set_look(look_of(transfer, brighter))
    assert not settle(picture).image().any()


def test_material_without_terms_or_with_zero_curves_is_black(transfer):
    def nothing(document):
        document["materials"]["Ball"]["terms"] = []

    def zero(document):
        for term in document["materials"]["Ball"]["terms"]:
            term["curves"] = {c.name: {"points": [[0, 0], [90, 0]]} for c in TERMS[term["model"]].curves}

    alone = pixels_of_ball_alone(transfer)
    picture = opened(transfer)
    for change in (nothing, zero, nothing):
        picture.set_look(look_of(transfer, change))
        image = settle(picture).image()
        assert not image[alone].any()
        assert image[~alone].any()
    picture.set_look(look_of(transfer))
    assert relative_rmse(settle(picture).image(), twins.full_evaluation(transfer, "front", look_of(transfer))) < 1e-6
