"""peer.mitsuba_time_ratio: how long Mitsuba 3 renders until its noise is as small as our error ÷ our time per edit.

Same teapot on a table, same camera, map and 512×512 pixels, same BRDF formula (a Python plugin that Mitsuba compiles
with the rest), variant llvm_ad_rgb, direct light with multiple importance sampling. Its error at a sample count is the
difference of two renders with other seeds over √2. Where the error that we have is not reached at the largest count,
the time is extrapolated by error ∝ 1/√spp, time ∝ spp, and the context says so. Scene loading and compiling are not
counted; nor is our bake.

Our error: the frame of 4,000 light triangles against `relume.reference` over 2,000 random view samples. Our time: a
change of σ that moves every coefficient, from the look to the encoded bytes (it does not depend on the lights).
bench/mitsuba.py says where Mitsuba is looked for.
"""

from __future__ import annotations

import copy
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from bench.figure import Figure, skipped
from bench.mitsuba import bsdf, missing, render
from bench.points import frame_radiance, lit_points, relative_rmse
from bench.scenes import LAMBERT, cook_torrance, environments, teapot_on_table
from relume.look import validate
from relume.look.terms import complete_term
from relume.reference import reference_radiance, texels_of
from relume.scene.model import Scene
from relume.store import bake_here
from relume.transfer.base import Recipe
from relume.transfer.cache import FrozenCache
from relume.transfer.direct import DirectMethod
from relume.transfer.opened import open_transfer
from relume.transfer.picture import Picture

_NAMES = ("peer.mitsuba_time_ratio",)
_SIGMA, _CURVES = 0.2, ("theta_i", "theta_h")
_TERMS = tuple(complete_term(("peer",), term, None) for term in (LAMBERT, cook_torrance(_SIGMA)))


def measure(tiny: bool) -> list[Figure]:
    """Their time to our error, and our time."""
    if (why := missing()) is not None:
        return skipped(_NAMES, "ratio", why)
    size = (32, 32) if tiny else (512, 512)
    scene = teapot_on_table(environments()[0], _TERMS, _TERMS)
    error = _our_error(scene, tiny)
    edit_s, frame = _our_edit(scene, size, tiny)
    with tempfile.TemporaryDirectory() as folder:
        job = {"spp": [1, 4] if tiny else [8, 32, 128, 512], "bsdfs": [bsdf(_TERMS)] * len(scene.meshes)}
        found = render(scene, size, job, Path(folder))
        picture = np.load(Path(folder) / "picture.npy", allow_pickle=False)
    last = found["steps"][-1]
    theirs_s = last["seconds"] * max(1.0, (last["error"] / error) ** 2)
    context = {
        "our_error": error,
        "our_edit_ms": 1e3 * edit_s,
        "their_seconds": theirs_s,
        "extrapolated_from_spp": last["spp"] if last["error"] > error else 0,
        "their_steps": found["steps"],
        "pictures_differ_median": float(np.median(np.abs(picture - frame) / np.maximum(frame, 1e-6))),
        "mitsuba": found["version"],
        "size": list(size),
    }
    return [Figure(_NAMES[0], theirs_s / edit_s, "ratio", context)]


def _our_error(scene: Scene, tiny: bool) -> float:
    lit = lit_points(scene, (320, 320), 20 if tiny else 2000, 200 if tiny else 4000, None)
    texels = texels_of(scene.environment)
    truth = reference_radiance(lit.geometry, texels, lit.points, [_TERMS], 500 if tiny else 0)[0]
    frame = sum(frame_radiance(lit, term, curve) for term, curve in zip(_TERMS, _CURVES, strict=True))
    return relative_rmse(np.asarray(frame), truth)


def _our_edit(scene: Scene, size: tuple[int, int], tiny: bool) -> tuple[float, Any]:
    """Median seconds of an edit, and the picture of the default look."""
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe("direct", ("front",), size, 60 if tiny else 1000)
        transfer = open_transfer(bake_here(DirectMethod(), scene, recipe, Path(folder) / "s.zarr"))
        picture = Picture(transfer, "front", FrozenCache(4 << 30))
        picture.touch("/materials/Teapot/terms/1/curves/theta_h")
        _settle(picture)
        shown = picture.image()
        taken = []
        for k in range(5 if tiny else 60):
            document = copy.deepcopy(transfer.default_look)
            document["materials"]["Teapot"]["terms"][1]["params"]["sigma"] = 0.1 + 0.2 * (k % 7) / 7
            look = validate(document, transfer.default_look)
            began = time.perf_counter()
            picture.set_look(look)
            picture.encode(picture.advance(None).tiles, "rgb9e5")
            taken.append(time.perf_counter() - began)
    return float(np.median(taken[1:])), shown


def _settle(picture: Picture) -> None:
    while not picture.advance(None).exact or picture.waiting() is not None:
        if picture.waiting() is not None:
            picture.freeze(lambda share: None, lambda: False)
