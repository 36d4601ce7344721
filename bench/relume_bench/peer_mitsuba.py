"""peer.mitsuba_time_ratio: time that Mitsuba 3 renders until its noise equals our error ÷ our time per edit.

Same teapot on a table, same camera, map and 512×512 pixels, same BRDF formula (a Python plugin that Mitsuba compiles
with the rest), variant llvm_ad_rgb, direct light with multiple importance sampling. Its error at a sample count is the
difference of two renders with different seeds over √2. If our error is not reached at the largest count, the time is
extrapolated by error ∝ 1/√spp, time ∝ spp, and the context says so. Scene loading, compiling and our bake are excluded.

Our error: the frame of 4,000 environment triangles against `relume.reference` over 2,000 random view samples. Our time:
a change of σ that changes every coefficient, from the look to the encoded bytes (independent of the lights). For the
installation of Mitsuba see bench/relume_bench/mitsuba.py.
"""

from __future__ import annotations

import copy
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from relume.brdf.term_validation import complete_term
from relume.core.cache import Cache
from relume.core.jackknife import JackknifeEstimate
from relume.live.fixed_camera.picture import Picture
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.methods.direct import DirectMethod
from relume.reference import environment_texels, reference_radiance
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.figure import Figure, skipped
from relume_bench.mitsuba import bsdf, missing, render
from relume_bench.points import frame_radiance, sample_lit_surface
from relume_bench.scenes import LAMBERT, cook_torrance, environments, teapot_on_table
from relume_bench.standard_error import estimate_point_error
from relume_bench.until_exact import run_until_exact

_NAMES = ("peer.mitsuba_time_ratio",)
_SIGMA, _CURVES = 0.2, ("theta_i", "theta_h")
_TERMS = tuple(complete_term(("peer",), term, None) for term in (LAMBERT, cook_torrance(_SIGMA)))


def measure(tiny: bool) -> list[Figure]:
    """Measure our error and our edit's time, then Mitsuba's time to reach that error."""
    if (why := missing()) is not None:
        return skipped(_NAMES, "ratio", why)
    size = (32, 32) if tiny else (512, 512)
    scene = teapot_on_table(environments()[0], _TERMS, _TERMS)
    error = _measure_relume_error(scene, tiny)
    edit_s, frame = _time_relume_edit(scene, size, tiny)
    with tempfile.TemporaryDirectory() as folder:
        job = {"spp": [1, 4] if tiny else [8, 32, 128, 512], "bsdfs": [bsdf(_TERMS)] * len(scene.meshes)}
        result = render(scene, size, job, Path(folder))
        picture = np.load(Path(folder) / "picture.npy", allow_pickle=False)
    last = result["steps"][-1]
    mitsuba_s = last["seconds"] * max(1.0, (last["error"] / error.value) ** 2)
    context = {
        "our_error": error.value,
        "our_error_standard_error": error.standard_error,
        "our_edit_ms": 1e3 * edit_s,
        "their_seconds": mitsuba_s,
        "extrapolated_from_spp": last["spp"] if last["error"] > error.value else 0,
        "their_steps": result["steps"],
        "pictures_differ_median": float(np.median(np.abs(picture - frame) / np.maximum(frame, 1e-6))),
        "mitsuba": result["version"],
        "size": list(size),
    }
    ratio = mitsuba_s / edit_s  # ∝ 1/error²
    return [Figure(_NAMES[0], ratio, "ratio", context, 2 * ratio * error.standard_error / error.value)]


def _measure_relume_error(scene: Scene, tiny: bool) -> JackknifeEstimate:
    lit_samples = sample_lit_surface(scene, (320, 320), 20 if tiny else 2000, 200 if tiny else 4000, None)
    texels = environment_texels(scene.environment)
    reference = reference_radiance(
        lit_samples.geometry, texels, lit_samples.surface_points, [_TERMS], 500 if tiny else 0
    )[0]
    frame = sum(frame_radiance(lit_samples, term, curve) for term, curve in zip(_TERMS, _CURVES, strict=True))
    return estimate_point_error(np.asarray(frame), reference)


def _time_relume_edit(scene: Scene, size: tuple[int, int], tiny: bool) -> tuple[float, Any]:
    """Median seconds of an edit, and the image of the default look."""
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe("direct", ("front",), size, 60 if tiny else 1000)
        transfer = open_transfer(
            bake_in_process(DirectMethod(), scene, recipe, Path(folder) / "s.zarr"), Cache(4 << 30)
        )
        picture = Picture(transfer, "front", Cache(4 << 30))
        picture.prepare("/materials/Teapot/terms/1/curves/theta_h")
        run_until_exact(picture)
        edited_image = picture.image()
        durations = []
        for k in range(5 if tiny else 60):
            document = copy.deepcopy(transfer.default_look)
            document["materials"]["Teapot"]["terms"][1]["params"]["sigma"] = 0.1 + 0.2 * (k % 7) / 7
            look = validate(document, transfer.default_look)
            start_time = time.perf_counter()
            picture.set_look(look)
            picture.encode(picture.advance(None).tiles, "rgb9e5")
            durations.append(time.perf_counter() - start_time)
    return float(np.median(durations[1:])), edited_image
