"""freeze.curve_switch_s: waiting time of a user who starts to edit another curve of a two-curve term.

17,700 view samples of the teapot × 4,000 environment triangles, cook_torrance; the merged-light operator along θh (256
bands, θd contracted) and the one along θd (64 bands, θh contracted), which update the image until the exact one is
ready. The larger of the two medians counts. In the context: the same for the exact operators, and the error of the
merged-light operator for a change of the curve, relative to that change.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from relume.assets.environments.studio import studio
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.core.thread_pools import num_threads
from relume.lights.light_clusters import cluster_lights, num_clusters
from relume.lights.tile_subdivision import choose_tiles
from relume.math.daubechies import analysis
from relume_bench.figure import Figure
from relume_bench.points import LitSamples, freeze_for_curve, relative_rmse, sample_lit_surface
from relume_bench.scenes import cook_torrance, teapot_on_table
from relume_bench.timing import time_interleaved


def lit_teapot(term: dict[str, Any], tiny: bool) -> LitSamples:
    """View samples of a teapot of one term, with their visible environment triangles."""
    num_positions, num_lights, size = (100, 200, (64, 64)) if tiny else (17_700, 4000, (320, 320))
    return sample_lit_surface(teapot_on_table(studio(), (term,), (term,)), size, num_positions, num_lights, material=0)


def merge_lights(lit_samples: LitSamples) -> LitSamples:
    """Merge the lights as for a merged-light operator."""
    radiance, num = studio().radiance, lit_samples.lights.num_lights
    return replace(
        lit_samples, lights=cluster_lights(lit_samples.lights, choose_tiles(radiance, num), num_clusters(num))
    )


def error_of_change(
    lit_samples: LitSamples, merged: LitSamples, before: dict[str, Any], after: dict[str, Any], curve: str
) -> float:
    """Error of T Δc with merged lights against all lights, relative RMSE.

    Args:
        lit_samples, merged: points with lights. before, after: documents with different `curve`.
    """
    declared = TERMS[before["model"]].curve(curve)
    change = analysis(curve_bands(after, declared)) - analysis(curve_bands(before, declared))
    images = []
    for variant in (merged, lit_samples):
        operator = freeze_for_curve(variant, before, curve)
        tiles, _, _, samples = operator.transport.shape
        image = np.zeros((tiles, 3, samples), np.float32)
        operator.add(change, image)
        images.append(image)
    return relative_rmse(*images)


def measure(tiny: bool) -> list[Figure]:
    """Freeze along both curves, alternating."""
    term = cook_torrance(0.2)
    document = complete_term(("curve_switch",), term, None)
    lit_samples = lit_teapot(document, tiny)
    curves = ("theta_h", "theta_d")
    merged = merge_lights(lit_samples)
    freezes = [
        partial(freeze_for_curve, variant, document, curve) for curve in curves for variant in (merged, lit_samples)
    ]
    names = [f"{curve}{suffix}_s" for curve in curves for suffix in ("", "_exact")]
    durations = time_interleaved(freezes, 2 if tiny else 5)
    medians = {name: float(np.median(times)) for name, times in zip(names, durations, strict=True)}
    other_term = complete_term(("curve_switch",), {**term, "params": {"sigma": 0.3, "ior": 2.5}}, None)
    context = {
        **medians,
        **{f"{curve}_error": error_of_change(lit_samples, merged, document, other_term, curve) for curve in curves},
        "merged_lights": merged.lights.num_lights,
        "view_samples": lit_samples.surface_points.num_points,
        "lights": lit_samples.lights.num_lights,
        "visible_fraction": float(np.unpackbits(lit_samples.receivers.visible).mean()),
        "threads": num_threads(),
    }
    return [Figure("freeze.curve_switch_s", max(medians[f"{curve}_s"] for curve in curves), "s", context)]
