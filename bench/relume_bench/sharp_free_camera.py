"""sharp.static_rmse_R, sharp.moving_rmse_R: the metal teapot of `relume_bench.sharp` through a free camera.

The bake of the method `probes`, 640×480, against the same images by Mitsuba: the static view after the camera stopped,
and the image while it moves.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from relume.core.cache import Cache
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.openers import open_bake
from relume.live.opened.static_view import StaticViewBuilder
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.examples.catalog import built_in
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench import sharp
from relume_bench.figure import Figure, skipped
from relume_bench.mitsuba import missing
from relume_bench.probes_reference import render_moving_camera

_KINDS = ("static", "moving")


def measure(tiny: bool) -> list[Figure]:
    """A bake, and two images for each roughness."""
    if (why := missing()) is not None:
        names = tuple(f"sharp.{kind}_rmse_{roughness}" for roughness in sharp.ROUGHNESSES for kind in _KINDS)
        return skipped(names, sharp.UNIT, why)
    scene, sizes, figures = built_in("still_life"), sharp.Sizes.choose(tiny), []
    recipe = Recipe("probes", (sharp.VIEW,), sizes.size, sizes.lights, num_probes=2000 if tiny else 50_000)
    with tempfile.TemporaryDirectory() as folder:
        bake = open_bake(bake_in_process(METHODS["probes"], scene, recipe, Path(folder) / "s.zarr"), Cache(4 << 30))
        assert isinstance(bake, BakedFreeCamera)
        builder = StaticViewBuilder(bake.light_transport, scene)
        for roughness in sharp.ROUGHNESSES:
            look = sharp.make_look(bake.default_look, "metal", roughness)
            images = {
                "static": render_image(bake, sharp.VIEW, look, static_views=builder),
                "moving": render_moving_camera(bake, sharp.VIEW, look),
            }
            passes, pot = sharp.teapot_passes("metal", roughness, tiny), sharp.find_teapot(tiny)
            context = {**sharp.describe("metal", roughness, tiny), "probes": recipe.num_probes}
            figures += [
                sharp.compare_images(f"sharp.{kind}_rmse_{roughness}", images[kind], passes, pot, context)
                for kind in _KINDS
            ]
    return figures
