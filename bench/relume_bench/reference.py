"""reference.mitsuba: our reference against Mitsuba 3, three scenes, same formulas and maps; the worst of the three.

Both render independent passes, ours at four times the size, averaged over 4 × 4 view samples like Mitsuba's box filter.
With m_k Mitsuba's passes and o_k ours, m_k − (o_k − ō) has Mitsuba's mean and the noise of both, so that
`relume.reference.comparison` separates errors from noise per pixel. Mitsuba reads the map bilinearly and we read its
texels, so the maps are smooth at the scale of a texel.
"""

from __future__ import annotations

import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.brdf.term_validation import complete_term
from relume.core.jackknife import JackknifeEstimate
from relume.look import default_look, validate
from relume.reference import reference_image
from relume.reference.comparison import Estimate, compare
from relume.scene.examples.still_life import demo_scene
from relume.scene.model import Material, Scene
from relume.scene.scene_folder import make_scene
from relume_bench.figure import Figure, skipped
from relume_bench.mitsuba import averaged, bsdf, missing, read_passes, render
from relume_bench.scenes import cook_torrance, make_sun_environment, teapot_on_table
from relume_bench.standard_error import compare_with_passes

F32 = NDArray[np.float32]
_NAMES = ("reference.mitsuba",)
_FINER = 4


def measure(tiny: bool) -> list[Figure]:
    """Difference of the two, with the noise removed."""
    if (why := missing()) is not None:
        return skipped(_NAMES, "relative RMSE", why)
    size, spp, passes = ((16, 12), 4, 2) if tiny else ((96, 72), 64, 8)
    disagreements = {
        name: _disagreement(scene, size, spp, passes) for name, scene in _make_scenes(64 if tiny else 1024).items()
    }
    context = {
        "size": list(size),
        "spp": spp,
        "passes": passes,
        **{name: details for name, (_, details) in disagreements.items()},
    }
    worst = max(error for error, _ in disagreements.values())
    return [Figure(_NAMES[0], worst.value, "relative RMSE", context, worst.standard_error)]


def _make_scenes(num_rows: int) -> dict[str, Scene]:
    """The teapot under a high sun, the still life under a low one, and from the left under a hazy one."""
    terms = _terms(0.5, 0.2)
    demo = demo_scene()
    gray = [
        Material(material.name, _terms(0.15 + 0.1 * k, 0.1 + 0.05 * k)) for k, material in enumerate(demo.materials)
    ]

    def make_still_life(view: int, light: Environment) -> Scene:
        return make_scene("Still life", demo.meshes, gray, demo.cameras[view : view + 1], light)

    return {
        "teapot, high sun": teapot_on_table(make_sun_environment("high", 0.8, num_rows), terms, terms),
        "still life, low sun": make_still_life(0, make_sun_environment("low", 0.3, num_rows)),
        "still life from the left, haze": make_still_life(1, make_sun_environment("haze", 0.5, num_rows, spread=0.02)),
    }


def _terms(albedo: float, sigma: float) -> tuple[dict[str, Any], ...]:
    lambert = {"model": "lambert", "color": [albedo] * 3}
    return tuple(complete_term(("reference",), term, None) for term in (lambert, cook_torrance(sigma)))


def _disagreement(
    scene: Scene, size: tuple[int, int], spp: int, passes: int
) -> tuple[JackknifeEstimate, dict[str, Any]]:
    """Difference of the two means, and the other results of `relume.reference.comparison.Comparison`.

    Args:
        scene: its first view is rendered by both.
        size: width and height of Mitsuba's images, pixels.
        spp: per pixel in each of Mitsuba's passes, and per view sample in ours.
        passes: passes of each renderer.
    """
    bsdfs = [bsdf(scene.materials[mesh.material].terms) for mesh in scene.meshes]
    with tempfile.TemporaryDirectory() as folder:
        render(scene, size, {"spp": [spp], "bsdfs": bsdfs, "passes": passes}, Path(folder))
        mitsuba_passes = read_passes(Path(folder))
    relume_passes = np.array([_render_relume_pass(scene, size, spp, k) for k in range(passes)])
    mean = relume_passes.mean(axis=0)
    estimate = Estimate.empty(size[1], size[0])
    combined = mitsuba_passes - (relume_passes - mean)
    for estimate_pass in combined:
        estimate = estimate.add(estimate_pass)
    comparison, _ = compare(mean, estimate)
    error, *_ = compare_with_passes(mean.astype(np.float64), combined)
    details = {**asdict(comparison), "error": error.value, "standard_error": error.standard_error}
    return error, {**details, "mean_ratio": float(mean.mean() / mitsuba_passes.mean())}


def _render_relume_pass(scene: Scene, size: tuple[int, int], spp: int, index: int) -> F32:
    width, height = size
    finer = (_FINER * width, _FINER * height)
    look = validate({}, default_look(scene.materials))
    image = reference_image(scene, scene.cameras[0].name, look, finer, spp, pass_index=index)
    return averaged(image, _FINER).astype(np.float32)
