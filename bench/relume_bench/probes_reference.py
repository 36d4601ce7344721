"""probes.rmse_*: the image of a moving free camera against Mitsuba's full path tracer.

The scenes of `relume_bench.probes`, all surfaces of one material: diffuse in the Cornell box under its environment, or
under one of the same power whose sun is an eighth as wide, with a radius of 0.5° (`hard_sun`); only a Blinn–Phong
highlight on the still life, as wide as a GGX one of roughness 0.5 and 0.3 (α = roughness², s = 2/α² − 2); or a GGX
metal, whose highlights have long tails, of these roughnesses, F0 of 0.9 (`ggx_…`; Mitsuba's `principled`). Mitsuba
traces all paths, including highlights that light other surfaces, which relume represents by few functions. Edges and
background are included. In the context, in percent: `fine_frame`, right after the camera stops and in approximate
renders; `static_view`, the fixed view that replaces it. Mitsuba's noise is removed:
`relume_bench.standard_error.compare_with_passes`.
"""

from __future__ import annotations

import copy
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.openers import open_bake, open_transfer
from relume.look import Look, complete, validate
from relume.look.document import MAX_BOUNCES
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.examples.catalog import built_in
from relume.scene.examples.cornell import sunny_environment
from relume.scene.model import Camera, Scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import bsdf, missing, read_passes, render
from relume_bench.standard_error import compare_with_passes

_GRAY = {"model": "lambert", "color": [0.7, 0.7, 0.7], "texture": None}
_LOOK_VARIANTS = {
    "diffuse": ("cornell_box", (400, 400)),
    "hard_sun": ("cornell_box", (400, 400)),
    "glossy_0.5": ("still_life", (640, 480)),
    "glossy_0.3": ("still_life", (640, 480)),
    "ggx_0.5": ("still_life", (640, 480)),
    "ggx_0.3": ("still_life", (640, 480)),
}
_F0 = 0.9  # of the metal
_GAIN = 0.23  # a highlight reflects up to four times its color
# per pass; 32 for others. With fewer the error is unknown: its distribution has heavy tails
_SPP = {"glossy_0.3": 128}
_HARD = np.radians(0.5), 512  # radius of a hard sun, rows of its map
_UNIT = "%"


def measure(tiny: bool) -> list[Figure]:
    """A bake, a frame and a render for each material."""
    if (why := missing()) is not None:
        return skipped(tuple(f"probes.rmse_{kind}" for kind in _LOOK_VARIANTS), _UNIT, why)
    return [_figure(kind, tiny) for kind in _LOOK_VARIANTS]


def _make_terms(kind: str) -> list[dict[str, Any]]:
    if kind in ("diffuse", "hard_sun"):
        return [_GRAY]
    if kind.startswith("ggx"):
        params = {"roughness": _number(kind), "f0": _F0}
        return [{"model": "ggx", "color": [1.0] * 3, "params": params, "texture": None}]
    exponent = 2 / _number(kind) ** 4 - 2
    return [{"model": "blinn_phong", "color": [_GAIN] * 3, "params": {"exponent": exponent}, "texture": None}]


def _number(kind: str) -> float:
    return float(kind.partition("_")[2])


def _make_mitsuba_bsdf(kind: str) -> dict[str, Any]:
    """The material as Mitsuba's."""
    if kind.startswith("ggx"):
        color = {"type": "rgb", "value": [_F0] * 3}
        return {"type": "principled", "base_color": color, "metallic": 1.0, "roughness": _number(kind)}
    return bsdf(_make_terms(kind))


def render_moving_camera(bake: BakedFreeCamera, view: str, look: Look) -> NDArray[np.float32]:
    """Render the image of a moving camera, with all light. bake, view, look: what is shown"""
    return moving_picture(bake, view, look).image()


def moving_picture(
    bake: BakedFreeCamera, view: str, look: Look, sized_camera: tuple[Camera, tuple[int, int]] | None = None
) -> FreeCameraPicture:
    """Make the picture of a moving camera, with all light.

    Args:
        bake, view, look: what is shown. sized_camera: another camera than the view's, and the size of the image.
    """
    picture = FreeCameraPicture(bake, view, is_watched=True)
    picture.set_look(look)
    if sized_camera is not None:
        picture.set_camera(*sized_camera)
    picture.advance(None)
    while (job := picture.next_job()) is not None and job.kind != "highlights":
        job.apply(job.run(lambda share: None, lambda: False))
        picture.advance(None)
    return picture


def _render_fixed_camera(scene: Scene, recipe: Recipe, folder: Path, look: Look) -> NDArray[np.float32]:
    """The fixed view from the same camera that replaces it."""
    path = bake_in_process(METHODS["gather"], scene, recipe, folder / "gather.zarr")
    return render_image(open_transfer(path, Cache(4 << 30)), recipe.views[0], look)[..., :3]


def _figure(kind: str, tiny: bool) -> Figure:
    name, size = _LOOK_VARIANTS[kind]
    terms, scene = _make_terms(kind), built_in("cornell_box" if tiny else name)
    if kind == "hard_sun":
        scene = replace(scene, environment=sunny_environment(radius=_HARD[0], rows=_HARD[1]))
    size, spp, num_lights, num_probes = ((40, 30), 2, 60, 2000) if tiny else (size, _SPP.get(kind, 32), 1000, 50_000)
    recipe = Recipe("probes", (scene.cameras[0].name,), size, num_lights, num_probes=num_probes)
    with tempfile.TemporaryDirectory() as folder:
        bake = open_bake(bake_in_process(METHODS["probes"], scene, recipe, Path(folder) / "s.zarr"), Cache(4 << 30))
        document = copy.deepcopy(complete({}, bake.default_look))
        for material in document["materials"].values():
            material["terms"] = copy.deepcopy(terms)
        look = validate(document, bake.default_look)
        fine_frame = render_image(bake, recipe.views[0], look)
        assert isinstance(bake, BakedFreeCamera)
        rendered = render_moving_camera(bake, recipe.views[0], look)
        fixed_camera_image = _render_fixed_camera(scene, replace(recipe, method="gather"), Path(folder), look)
        integrator = {"type": "path", "max_depth": MAX_BOUNCES + 2, "rr_depth": 6}
        job = {
            "spp": [spp],
            "passes": PASSES,
            "bsdfs": [_make_mitsuba_bsdf(kind)] * len(scene.meshes),
            "integrator": integrator,
        }
        render(scene, size, job, Path(folder))
        reference_passes = read_passes(Path(folder))
    comparison = compare_with_passes(rendered.astype(np.float64), reference_passes)
    rested = compare_with_passes(fixed_camera_image.astype(np.float64), reference_passes)
    error_details = {
        "fine_frame": 100 * compare_with_passes(fine_frame.astype(np.float64), reference_passes).error.value,
        "static_view": 100 * rested.error.value,
        "static_view_bias": rested.context["bias"],
    }
    context = {
        **comparison.context,
        **error_details,
        "scene": scene.name,
        "size": list(size),
        "spp": PASSES * spp,
        "probes": num_probes,
    }
    return Figure(
        f"probes.rmse_{kind}", 100 * comparison.error.value, _UNIT, context, 100 * comparison.error.standard_error
    )
