"""gather.rmse_diffuse and gather.rmse_glossy: the picture's reflected light against Mitsuba's path tracer.

The bake of bench/gather.py. Diffuse: the whole picture, its floor's highlight taken away. Glossy: the highlight of the
floor alone (exponent 100) over the floor's pixels, lit by surfaces that reflect diffusely. Direct light is in neither,
and Mitsuba has as many bounces as we have. Its own noise is taken off: `bench.standard_error.over_passes`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.figure import Figure, skipped
from bench.gather import bake, recipe_of
from bench.indirect import PASSES, highlights_send_nothing, reflected, reflected_by_mitsuba
from bench.mitsuba import bsdf, missing
from bench.standard_error import over_passes
from relume.memory import Memory
from relume.methods.registry import open_transfer
from relume.picture.transfer import Transfer
from relume.scene.cornell import GLOSSY_FLOOR, cornell_box

_NAMES = ("gather.rmse_diffuse", "gather.rmse_glossy")
_UNIT = "relative RMSE"


def measure(tiny: bool) -> list[Figure]:
    """A bake, two renders."""
    if (why := missing()) is not None:
        return skipped(_NAMES, _UNIT, why)
    scene, recipe = cornell_box(is_floor_glossy=True), recipe_of(tiny)
    spp = {"diffuse": 2, "glossy": 2} if tiny else {"diffuse": 128, "glossy": 64}  # of each pass
    diffuse, glossy = GLOSSY_FLOOR
    beyond = [bsdf(scene.materials[mesh.material].terms[:1]) for mesh in scene.meshes]
    highlight = bsdf([glossy])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        transfer = open_transfer(bake(scene, recipe, folder / "gather.zarr").path, Memory(4 << 30))
        with highlights_send_nothing():
            plain, both = (reflected(transfer, terms) for terms in ({"Floor": (diffuse,)}, {}))
        theirs = {
            "diffuse": reflected_by_mitsuba(scene, recipe.size, beyond, beyond, spp["diffuse"], folder),
            "glossy": reflected_by_mitsuba(scene, recipe.size, [highlight, *beyond[1:]], beyond, spp["glossy"], folder),
        }
        on_floor = _is_all_floor(transfer)
    found = {
        "diffuse": over_passes(plain, theirs["diffuse"]),
        "glossy": over_passes(on_floor[..., None] * (both - plain), on_floor[..., None] * theirs["glossy"]),
    }
    return [
        Figure(
            f"gather.rmse_{kind}", of.error.value, _UNIT,
            {**of.context, "size": list(recipe.size), "spp": PASSES * spp[kind]}, of.error.standard_error,
        )
        for kind, of in found.items()
    ]  # fmt: skip


def _is_all_floor(transfer: Transfer) -> Any:
    """Pixels that nothing else has a part in. (height, width) bool"""
    view = transfer.views["front"]
    is_floor = np.zeros(view.num_view_samples, bool)
    is_floor[view.rows(transfer.material_names.index("Floor"))] = True
    pixel_of = np.repeat(np.arange(view.width * view.height), np.diff(view.first))
    share = np.bincount(pixel_of, view.gains[:, 0] * is_floor[view.order], view.width * view.height)
    return share.reshape(view.height, view.width) > 1 - 1e-6
