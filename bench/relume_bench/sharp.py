"""sharp.rmse_R, sharp.speckle_R, sharp.rmse_plastic_R: a polished teapot in the still life against Mitsuba.

The teapot is a GGX metal of roughness R, or plastic: a GGX coat over a diffuse base. Method `gather`, all light, exact
image of 640×480. Error: both images averaged over 2 × 2 pixels, Mitsuba's noise removed; the context has that of the
teapot's pixels, `inside`, and of the others, with their bias. Ten pixels that mirror the small light decide it at low
roughness; `clipped` is that inside with radiance above 4 cut off, `display_rms` of display values in [0, 1], with
noise. Speckle: 99.9th percentile of |pixel − median of 3 × 3| after the default look's tone mapping, over teapot and
two pixels around it, ours ÷ Mitsuba's. Mitsuba renders few paths a pixel of the whole image, and many of the teapot:
`spp` in the context. Its images are stored (`relume_bench.mitsuba.cached_passes`), so that later runs render only ours.
"""

from __future__ import annotations

import atexit
import copy
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, median_filter

from relume.brdf.registry import TERMS
from relume.core.cache import Cache
from relume.image_io.tone_mapping import tone_map
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import Look, validate
from relume.look.document import MAX_BOUNCES
from relume.output.render_image import render_image
from relume.scene.examples.catalog import built_in
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure, skipped
from relume_bench.gather import bake
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import averaged, bsdf, cached_passes, missing
from relume_bench.standard_error import compare_pixels

F32 = NDArray[np.float32]
Mask = NDArray[np.bool_]

VIEW, MATERIAL = "front", "Teapot"
ROUGHNESSES = (0.02, 0.05, 0.1, 0.2, 0.3)
FINER = 2  # pixels that are averaged along each side
UNIT = "relative RMSE"
_METAL_F0 = [0.95, 0.90, 0.80]
_BASE = [0.24, 0.016, 0.012]
_MARGIN, _BLOCK = 2, 16  # pixels around the teapot; side of blocks of pixels
_BRIGHT = 4.0  # radiance; about four times white paper
_RR_DEPTH = 3  # russian roulette from this depth


class Sizes(NamedTuple):
    """Width and height of images; lights of bakes; Mitsuba's paths a pixel and pass, of the whole and of the teapot."""

    size: tuple[int, int]
    lights: int
    spp: int
    detail_spp: int

    @classmethod
    def choose(cls, tiny: bool) -> Sizes:
        """The measured sizes, or with `tiny` those of a trial run."""
        return cls((40, 30), 60, 1, 2) if tiny else cls((640, 480), 2000, 16, 56)


def measure(tiny: bool, kind: str = "metal", roughness: float = 0.1) -> list[Figure]:
    """Measure one material; the bake is made once in a process.

    Args:
        tiny: a trial run. kind: "metal" or "plastic". roughness: of its GGX term.
    """
    is_metal = kind == "metal"
    name = f"sharp.rmse_{roughness}" if is_metal else f"sharp.rmse_{kind}_{roughness}"
    speckle_names = (f"sharp.speckle_{roughness}",) if is_metal else ()
    if (why := missing()) is not None:
        return [*skipped((name,), UNIT, why), *skipped(speckle_names, "ratio", why)]
    transfer, pot = open_still_life(tiny), find_teapot(tiny)
    look = make_look(transfer.default_look, kind, roughness)
    image, passes = render_image(transfer, VIEW, look), teapot_passes(kind, roughness, tiny)
    mean = np.asarray(passes.mean(axis=0), np.float32)
    displayed = [tone_map(picture, look.display.exposure, look.display.tone_map) for picture in (image, mean)]
    details = describe(kind, roughness, tiny)
    display_rms = float(np.sqrt(np.mean((displayed[0] - displayed[1])[pot] ** 2)))
    error = compare_images(name, image, passes, pot, {**details, "display_rms": display_rms})
    return [error, *(_compare_speckle(speckle, displayed, pot, details) for speckle in speckle_names)]


def _compare_speckle(figure: str, displayed: Sequence[F32], pot: Mask, details: Mapping[str, Any]) -> Figure:
    """Ratio of the 99.9th percentiles of two displayed images, ours and Mitsuba's; see the module.

    In the context: both, the ratio of the 99th percentiles, and the 99.9th of ours minus Mitsuba's, pixel by pixel,
    which excludes what is as sharp in both.
    """
    near = binary_dilation(pot, iterations=_MARGIN)
    ours, mitsuba = (np.abs(image - median_filter(image, size=(3, 3, 1)))[near] for image in displayed)
    (lower, highest), (mitsuba_lower, mitsuba_highest) = (np.percentile(d, [99, 99.9]) for d in (ours, mitsuba))
    context = {
        "ours": highest, "mitsuba": mitsuba_highest, "ratio_99": lower / mitsuba_lower,
        "excess": np.percentile(ours - mitsuba, 99.9), **details,
    }  # fmt: skip
    return Figure(figure, float(highest / mitsuba_highest), "ratio", context)


@cache
def open_still_life(tiny: bool) -> FixedViewTransfer:
    """The still life, baked for a fixed camera with its own materials."""
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    return bake_and_open(built_in("still_life"), tiny, Path(folder.name))


def bake_and_open(scene: Scene, tiny: bool, folder: Path) -> FixedViewTransfer:
    """A scene, baked for its fixed camera `VIEW` in a folder. tiny: a trial run"""
    sizes = Sizes.choose(tiny)
    recipe = Recipe("gather", (VIEW,), sizes.size, sizes.lights)
    return open_transfer(bake(scene, recipe, folder / "gather.zarr").path, Cache(4 << 30))


def find_teapot(tiny: bool) -> Mask:
    """Pixels of the teapot. (height, width)"""
    transfer = open_still_life(tiny)
    return np.asarray(transfer.views[VIEW].material_ids() == transfer.material_names.index(MATERIAL))


def make_terms(kind: str, roughness: float) -> list[dict[str, Any]]:
    """Terms of the teapot."""
    f0 = _METAL_F0 if kind == "metal" else 0.04
    gloss = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": roughness, "f0": f0}, "texture": None}
    base = [] if kind == "metal" else [{"model": "lambert", "color": _BASE, "texture": None}]
    return [*base, gloss]


def allowed(roughness: float) -> float:
    """The nearest roughness that looks allow."""
    return max(roughness, TERMS["ggx"].parameter("roughness").minimum)


def make_look(default: Mapping[str, Any], kind: str, roughness: float) -> Look:
    """The default look with another teapot, as sharp as looks allow. kind, roughness: as in `measure`"""
    document = copy.deepcopy(dict(default))
    document["materials"][MATERIAL]["terms"] = make_terms(kind, allowed(roughness))
    return validate(document, default)


def describe(kind: str, roughness: float, tiny: bool) -> dict[str, Any]:
    """Context of all figures of a material. kind, roughness, tiny: as in `measure`"""
    sizes = Sizes.choose(tiny)
    return {
        "kind": kind, "our_roughness": allowed(roughness), "size": list(sizes.size), "lights": sizes.lights,
        "spp": PASSES * sizes.spp, "teapot_spp": PASSES * sizes.detail_spp,
    }  # fmt: skip


def teapot_passes(kind: str, roughness: float, tiny: bool) -> F32:
    """Mitsuba's independent images, with more paths for the teapot. (passes, height, width, 3)

    Args:
        kind, roughness, tiny: as in `measure`.
    """
    scene, sizes = built_in("still_life"), Sizes.choose(tiny)
    bsdfs, wood = [_describe_material(scene, mesh.material, kind, roughness) for mesh in scene.meshes], _wood(scene)
    rows, columns = _bound(find_teapot(tiny))
    crop = [columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start]
    job = make_job(bsdfs)
    passes = cached_passes(scene, sizes.size, {**job, "spp": [sizes.spp]}, wood)
    detail = {**job, "spp": [sizes.detail_spp], "crop": crop}
    passes[:, rows, columns] = cached_passes(scene, sizes.size, detail, wood)
    return passes


def _bound(mask: Mask) -> tuple[slice, slice]:
    """Rows and columns around a mask, in whole blocks of pixels, so that a sample more does not change them."""
    padded = binary_dilation(mask, iterations=_MARGIN)
    bounds = []
    for num, hits in zip(mask.shape, np.nonzero(padded), strict=True):
        start, stop = int(hits.min()) // _BLOCK * _BLOCK, -(-int(hits.max() + 1) // _BLOCK) * _BLOCK
        bounds.append(slice(start, min(stop, num)))
    return bounds[0], bounds[1]


def make_job(bsdfs: list[dict[str, Any]]) -> dict[str, Any]:
    """Job for Mitsuba's path tracer, without counts; pixels are stratified, because highlights vary within them."""
    return {
        "passes": PASSES, "bsdfs": bsdfs, "sampler": "multijitter", "most": 64,
        "integrator": {"type": "path", "max_depth": MAX_BOUNCES + 2, "rr_depth": _RR_DEPTH},
    }  # fmt: skip


def _wood(scene: Scene) -> dict[str, F32]:
    tray = next(material for material in scene.materials if material.name == "Tray")
    return {"wood": tray.textures["diffuse"].pixels}


def _describe_material(scene: Scene, index: int, kind: str, roughness: float) -> dict[str, Any]:
    material = scene.materials[index]
    if material.name == MATERIAL:
        return bsdf(make_terms(kind, allowed(roughness))) | {"roughness": roughness}
    return bsdf(material.terms) | ({"albedo": {"array": "wood"}} if material.name == "Tray" else {})


def compare_images(
    figure: str, image: F32, passes: F32, mask: Mask, details: Mapping[str, Any], pixels: str = "whole"
) -> Figure:
    """Figure of the error of an image, averaged over small blocks of pixels.

    Args:
        figure: its name. image: ours, (height, width, 3). passes: Mitsuba's, (passes, height, width, 3).
        mask: pixels "inside"; the others are "outside". (height, width)
        details: further context. pixels: "whole", "inside" or "outside": those of the value; all are in the context.
    """
    coarse = np.array([averaged(picture, FINER) for picture in passes], np.float32)
    rendered, height, width = averaged(image, FINER), len(image) // FINER, image.shape[1] // FINER
    inside: Mask = np.asarray(mask.reshape(height, FINER, width, FINER).any(axis=(1, 3)))
    masks = {"whole": inside | True, "inside": inside, "outside": ~inside}
    comparisons = {name: compare_pixels(rendered, coarse, mask) for name, mask in masks.items()}
    clipped = compare_pixels(np.minimum(rendered, _BRIGHT), np.minimum(coarse, _BRIGHT), inside).summary
    summaries = {name: comparison.summary for name, comparison in comparisons.items()}
    error, context = comparisons[pixels].error, comparisons[pixels].context
    return Figure(
        figure, error.value, UNIT, {**context, **summaries, "clipped": clipped, **details}, error.standard_error
    )
