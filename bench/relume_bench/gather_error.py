"""gather.rmse_diffuse and gather.rmse_glossy: the image's indirect light against Mitsuba's path tracer.

The bake of `relume_bench.gather`. Diffuse: the whole image without its floor's highlight. Glossy: only the highlight of
the floor (exponent 100) over the floor's pixels, lit by diffuse surfaces. Neither contains direct light, and Mitsuba
has the same number of bounces. Its noise is removed: `relume_bench.standard_error.compare_with_passes`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from relume.core.cache import Cache
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.scene.examples.cornell import GLOSSY_FLOOR, cornell_box
from relume_bench.figure import Figure, skipped
from relume_bench.gather import bake, make_recipe
from relume_bench.indirect import PASSES, ignore_glossy_reflection, reflected, reflected_by_mitsuba
from relume_bench.mitsuba import bsdf, missing
from relume_bench.standard_error import compare_with_passes

_NAMES = ("gather.rmse_diffuse", "gather.rmse_glossy")
_UNIT = "relative RMSE"


def measure(tiny: bool) -> list[Figure]:
    """A bake, two renders."""
    if (why := missing()) is not None:
        return skipped(_NAMES, _UNIT, why)
    scene, recipe = cornell_box(is_floor_glossy=True), make_recipe(tiny)
    spp = {"diffuse": 2, "glossy": 2} if tiny else {"diffuse": 128, "glossy": 64}  # of each pass
    diffuse, glossy = GLOSSY_FLOOR
    beyond = [bsdf(scene.materials[mesh.material].terms[:1]) for mesh in scene.meshes]
    highlight = bsdf([glossy])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        transfer = open_transfer(bake(scene, recipe, folder / "gather.zarr").path, Cache(4 << 30))
        with ignore_glossy_reflection():
            plain, all_terms = (reflected(transfer, terms) for terms in ({"Floor": (diffuse,)}, {}))
        reference_passes = {
            "diffuse": reflected_by_mitsuba(scene, recipe.size, beyond, beyond, spp["diffuse"], folder),
            "glossy": reflected_by_mitsuba(scene, recipe.size, [highlight, *beyond[1:]], beyond, spp["glossy"], folder),
        }
        on_floor = _is_all_floor(transfer)
    comparisons = {
        "diffuse": compare_with_passes(plain, reference_passes["diffuse"]),
        "glossy": compare_with_passes(
            on_floor[..., None] * (all_terms - plain), on_floor[..., None] * reference_passes["glossy"]
        ),
    }
    return [
        Figure(
            f"gather.rmse_{kind}", comparison.error.value, _UNIT,
            {**comparison.context, "size": list(recipe.size), "spp": PASSES * spp[kind]},
            comparison.error.standard_error,
        )
        for kind, comparison in comparisons.items()
    ]  # fmt: skip


def _is_all_floor(transfer: FixedViewTransfer) -> Any:
    """Mask of pixels that show the floor only. (height, width) bool"""
    view = transfer.views["front"]
    is_floor = np.zeros(view.num_view_samples, bool)
    is_floor[view.rows(transfer.material_names.index("Floor"))] = True
    pixel_index = np.repeat(np.arange(view.width * view.height), np.diff(view.first))
    floor_coverage = np.bincount(pixel_index, view.throughput[:, 0] * is_floor[view.order], view.width * view.height)
    return floor_coverage.reshape(view.height, view.width) > 1 - 1e-6
