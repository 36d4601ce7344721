"""peer.mitsuba_gather_time_ratio and peer.cycles_time_ratio: time that they render, after an edit of a material under
global illumination, until their noise equals our error ÷ our time for the edit's frame.

The bake and the edit of `relume_bench.gather`: the exponent of the floor's highlight. Our error: the indirect light of
the whole image against Mitsuba's path tracer, its noise removed, or its upper bound if it is below the noise. Mitsuba
renders indirect light alone, as in `relume_bench.indirect`, which is less work than an image. Cycles renders whole
images, with a Beckmann highlight of the same width instead of Blinn–Phong; its noise is compared with our error in the
same units. Both have the full material of every surface: our approximation of light reflected by highlights is part of
our error. Noise is the difference of two seeds over √2; if our error is not reached at the largest count, the time is
extrapolated by noise ∝ 1/√spp, time ∝ spp, and the context says so. Scene loading, compiling and our bake are excluded.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from relume.core.cache import Cache
from relume.core.jackknife import JackknifeEstimate
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look.document import MAX_BOUNCES
from relume.scene.examples.cornell import GLOSSY_FLOOR, cornell_box
from relume.scene.model import Scene
from relume_bench import cycles, mitsuba
from relume_bench.figure import Figure, skipped
from relume_bench.gather import FLOOR, bake, edit_frames_s, make_recipe, open_exact_picture
from relume_bench.indirect import mitsuba_job, reflected, reflected_by_mitsuba
from relume_bench.standard_error import compare_with_passes
from relume_bench.until_exact import run_until_exact

_NAMES = ("peer.mitsuba_gather_time_ratio", "peer.cycles_time_ratio")


class _RelumeResult(NamedTuple):
    """Error of indirect light, absolute; seconds of an edit's frame."""

    error: JackknifeEstimate
    edit_s: float


def measure(tiny: bool) -> list[Figure]:
    """Measure our edit and its error, then the others' times to reach it."""
    if (why := mitsuba.missing()) is not None:
        return skipped(_NAMES, "ratio", f"our error is unknown: {why}")
    scene, recipe = cornell_box(is_floor_glossy=True), make_recipe(tiny)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        transfer = open_transfer(bake(scene, recipe, folder / "gather.zarr").path, Cache(4 << 30))
        edit_s = _edit_s(transfer, 5 if tiny else 60)
        light = reflected(transfer, {})
        bsdfs = [mitsuba.bsdf(scene.materials[mesh.material].terms) for mesh in scene.meshes]
        reference_passes = reflected_by_mitsuba(scene, recipe.size, bsdfs, bsdfs, 2 if tiny else 128, folder)
        scale = float(np.sqrt(np.mean(light**2)))
        comparison = compare_with_passes(light, reference_passes)
        error = comparison.error.value if comparison.is_significant else comparison.limit
        relume = _RelumeResult(JackknifeEstimate(error * scale, comparison.error.standard_error * scale), edit_s)
        job = {"spp": [1, 2] if tiny else [8, 64], **mitsuba_job(bsdfs, bsdfs)}
        steps = mitsuba.render(scene, recipe.size, job, folder)
        mitsuba_steps = [{**step, "noise": step["error"] * scale} for step in steps["steps"]]
        details = {"mitsuba": steps["version"], "error": comparison.error.value, **comparison.context}
        figures = [_ratio(_NAMES[0], mitsuba_steps, relume, details)]
        if (why := cycles.missing()) is not None:
            return figures + skipped(_NAMES[1:], "ratio", why)
        spp = [1, 2] if tiny else [4, 32]
        rendered = cycles.render(scene, recipe.size, _materials(scene), spp, MAX_BOUNCES, folder)
    return [*figures, _ratio(_NAMES[1], rendered["steps"], relume, {"blender": rendered["version"]})]


def _ratio(name: str, steps: list[dict[str, Any]], relume: _RelumeResult, details: dict[str, Any]) -> Figure:
    last = steps[-1]
    mitsuba_s = last["seconds"] * max(1 / last["spp"], (last["noise"] / relume.error.value) ** 2)
    ratio = mitsuba_s / relume.edit_s  # ∝ 1/error²
    context = {
        "our_error": relume.error.value, "our_edit_ms": 1e3 * relume.edit_s, "their_seconds": mitsuba_s,
        "extrapolated_from_spp": last["spp"] if last["noise"] > relume.error.value else 0, "their_steps": steps,
        **details,
    }  # fmt: skip
    return Figure(name, ratio, "ratio", context, 2 * ratio * relume.error.standard_error / relume.error.value)


def _edit_s(transfer: FixedViewTransfer, num_frames: int) -> float:
    """Median seconds of the frames of a drag."""
    picture = open_exact_picture(transfer)
    picture.prepare(f"{FLOOR}/params/exponent")
    run_until_exact(picture)
    return float(np.median(edit_frames_s(transfer, picture, num_frames)))


def _materials(scene: Scene) -> list[dict[str, Any]]:
    """Materials for Cycles; its highlight has four times the albedo of the floor's color, and α² = 2/(s + 2)."""
    floor = GLOSSY_FLOOR[1]
    alpha = (2 / (floor["params"]["exponent"] + 2)) ** 0.5
    black = {"glossy": [0.0, 0.0, 0.0], "roughness": 0.0}
    bsdfs = [{"diffuse": scene.materials[mesh.material].terms[0]["color"], **black} for mesh in scene.meshes]
    bsdfs[0] |= {"glossy": [4 * channel for channel in floor["color"]], "roughness": alpha**0.5}
    return bsdfs
