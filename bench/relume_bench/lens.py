"""lens.rmse: depth of field in the still life against Mitsuba's thin lens.

Method `direct`: direct light, with a teapot of rough metal, focused on the lid. Relative RMSE of pixels, without
Mitsuba's noise; the context has the samples per pixel, and the error of the same image without a lens, as `sharp`.
"""

from __future__ import annotations

import tempfile
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.examples.catalog import built_in
from relume.scene.lens import Lens
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import cached_passes, missing
from relume_bench.sharp import UNIT, VIEW, describe_materials, make_look, wood_image
from relume_bench.standard_error import NoiseCorrectedError, compare_pixels

_NAME = "lens.rmse"
_LENS = Lens(0.01, 0.95)
_MATERIAL = "metal", 0.3
_SIZE, _SPP, _LIGHTS = (320, 240), 64, 2000


def measure(tiny: bool) -> list[Figure]:
    """Two bakes and their renders, with and without the lens."""
    if (why := missing()) is not None:
        return skipped((_NAME,), UNIT, why)
    size, spp, lights = ((40, 30), 2, 60) if tiny else (_SIZE, _SPP, _LIGHTS)
    (blurred, samples_per_pixel), (sharp, _) = (_compare(lens, size, spp, lights) for lens in (_LENS, None))
    context = {
        **blurred.context, "sharp": sharp.error.value, "samples_per_pixel": samples_per_pixel, "size": list(size),
        "spp": PASSES * spp, "lights": lights, **asdict(_LENS),
    }  # fmt: skip
    return [Figure(_NAME, blurred.error.value, UNIT, context, blurred.error.standard_error)]


def _compare(lens: Lens | None, size: tuple[int, int], spp: int, lights: int) -> tuple[NoiseCorrectedError, float]:
    """Compare our image with Mitsuba's; and the number of samples per pixel."""
    image, samples_per_pixel = render_relume(lens, size, lights)
    return compare_pixels(image, render_mitsuba(lens, size, spp), np.ones(image.shape[:2], np.bool_)), samples_per_pixel


def render_relume(lens: Lens | None, size: tuple[int, int], lights: int) -> tuple[NDArray[np.float32], float]:
    """Our image, and its samples per pixel."""
    scene = built_in("still_life")
    cameras = tuple(replace(camera, lens=lens) for camera in scene.cameras if camera.name == VIEW)
    recipe = Recipe("direct", (VIEW,), size, lights)
    with tempfile.TemporaryDirectory() as folder:
        path = bake_in_process(METHODS["direct"], replace(scene, cameras=cameras), recipe, Path(folder) / "lens.zarr")
        transfer = open_transfer(path, Cache(4 << 30))
        image = render_image(transfer, VIEW, make_look(transfer.default_look, *_MATERIAL))
        return image, len(transfer.views[VIEW].pixel) / (size[0] * size[1])


def render_mitsuba(lens: Lens | None, size: tuple[int, int], spp: int) -> NDArray[np.float32]:
    """Mitsuba's independent images. (passes, height, width, 3)"""
    scene = built_in("still_life")
    lens_job = {} if lens is None else {"lens": {"aperture_radius": lens.radius, "focus_distance": lens.focus_distance}}
    job = {"passes": PASSES, "bsdfs": describe_materials(scene, *_MATERIAL), "sampler": "multijitter", **lens_job}
    return cached_passes(scene, size, {**job, "spp": [spp], "most": 64}, wood_image(scene))
