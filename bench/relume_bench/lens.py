"""lens.rmse: depth of field in the still life against Mitsuba's thin lens.

Method `direct`: direct light on the diffuse terms of the materials, focused on the teapot; our image is averaged over
2 × 2 pixels. Relative RMSE without Mitsuba's noise. The context has the samples per pixel of ours before that, and the
error of the same image without a lens, `sharp`.
"""

from __future__ import annotations

import tempfile
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.examples.catalog import built_in
from relume.scene.lens import Lens
from relume.scene.model import Material, Scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import averaged, bsdf, cached_passes, missing
from relume_bench.standard_error import NoiseCorrectedError, compare_pixels

_NAME, _VIEW, _UNIT = "lens.rmse", "front", "relative RMSE"
_LENS = Lens(0.02, 0.95)
_SIZE, _FINER, _SPP, _LIGHTS = (160, 120), 2, 64, 2000


def measure(tiny: bool) -> list[Figure]:
    """Two bakes and their renders, with and without the lens."""
    if (why := missing()) is not None:
        return skipped((_NAME,), _UNIT, why)
    size, spp, lights = ((40, 30), 2, 60) if tiny else (_SIZE, _SPP, _LIGHTS)
    (blurred, samples_per_pixel), (sharp, _) = (_compare(lens, size, spp, lights) for lens in (_LENS, None))
    context = {
        **blurred.context, "sharp": sharp.error.value, "samples_per_pixel": samples_per_pixel, "size": list(size),
        "spp": PASSES * spp, "lights": lights, **asdict(_LENS),
    }  # fmt: skip
    return [Figure(_NAME, blurred.error.value, _UNIT, context, blurred.error.standard_error)]


def _compare(lens: Lens | None, size: tuple[int, int], spp: int, lights: int) -> tuple[NoiseCorrectedError, float]:
    """Compare our image with Mitsuba's; and the number of samples per pixel."""
    scene = _matte_still_life()
    image, samples_per_pixel = _render_relume(scene, lens, size, lights)
    passes = _render_mitsuba(scene, lens, size, spp)
    return compare_pixels(image, passes, np.ones(image.shape[:2], np.bool_)), samples_per_pixel


def _render_relume(
    scene: Scene, lens: Lens | None, size: tuple[int, int], lights: int
) -> tuple[NDArray[np.float64], float]:
    """Our image, and its samples per pixel."""
    cameras = tuple(replace(camera, lens=lens) for camera in scene.cameras if camera.name == _VIEW)
    fine = _FINER * size[0], _FINER * size[1]
    recipe = Recipe("direct", (_VIEW,), fine, lights)
    with tempfile.TemporaryDirectory() as folder:
        path = bake_in_process(METHODS["direct"], replace(scene, cameras=cameras), recipe, Path(folder) / "lens.zarr")
        transfer = open_transfer(path, Cache(4 << 30))
        image = render_image(transfer, _VIEW, validate({}, transfer.default_look))
        return averaged(image, _FINER), len(transfer.views[_VIEW].pixel) / (fine[0] * fine[1])


def _render_mitsuba(scene: Scene, lens: Lens | None, size: tuple[int, int], spp: int) -> NDArray[np.float32]:
    """Mitsuba's independent images. (passes, height, width, 3)"""
    lens_job = {} if lens is None else {"lens": {"aperture_radius": lens.radius, "focus_distance": lens.focus_distance}}
    bsdfs, images = [], dict[str, NDArray[np.float32]]()
    for mesh in scene.meshes:
        material = scene.materials[mesh.material]
        texture = material.textures.get("diffuse")
        bsdfs.append(bsdf(material.terms) | ({} if texture is None else {"albedo": {"array": material.name}}))
        images |= {} if texture is None else {material.name: texture.pixels}
    job = {"passes": PASSES, "bsdfs": bsdfs, "sampler": "multijitter", "spp": [spp], "most": 64, **lens_job}
    return cached_passes(scene, size, job, images)


def _matte_still_life() -> Scene:
    """The still life without highlights, in which a few pixels would decide the error."""
    scene = built_in("still_life")
    return replace(scene, materials=tuple(map(_matte, scene.materials)))


def _matte(material: Material) -> Material:
    """The diffuse terms of a material; for metals, one of their color."""
    diffuse = tuple(term for term in material.terms if term["model"] == "lambert")
    return replace(material, terms=diffuse or ({"model": "lambert", "color": [0.5, 0.5, 0.5]},))
