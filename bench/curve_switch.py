"""freeze.curve_switch_s: what a user waits who touches another curve of a two-curve term.

17,700 view samples of the teapot × 4,000 light triangles, cook_torrance; the rough operator along θh (256 bands, θd
contracted) and the one along θd (64 bands, θh contracted), by which the picture follows the hand until the exact one is
there. The larger of the two medians counts. In the row: the same of the exact ones, and how far the rough one is from
what the exact one makes of a change of the curve, as a share of that change.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from bench.figure import Figure
from bench.points import Lit, freeze_along, lit_points, relative_rmse
from bench.scenes import cook_torrance, teapot_on_table
from bench.timing import in_turn
from relume.basis.daubechies import analysis
from relume.brdf.curves import curve_bands
from relume.brdf.document import complete_term
from relume.brdf.registry import TERMS
from relume.environments.studio import studio
from relume.light.merged import merge, num_merged
from relume.light.tiles import choose_tiles
from relume.parallel import num_threads


def lit_teapot(term: dict[str, Any], tiny: bool) -> Lit:
    """View samples of a teapot, all of one term, with their light triangles and what they see of them."""
    num_points, num_lights, size = (100, 200, (64, 64)) if tiny else (17_700, 4000, (320, 320))
    return lit_points(teapot_on_table(studio(), (term,), (term,)), size, num_points, num_lights, material=0)


def rough(lit: Lit) -> Lit:
    """The same with the lights merged that an operator is made of first."""
    radiance, num = studio().radiance, lit.lights.num_lights
    return replace(lit, lights=merge(lit.lights, choose_tiles(radiance, num), num_merged(num)))


def error_of_change(lit: Lit, merged: Lit, before: dict[str, Any], after: dict[str, Any], curve: str) -> float:
    """How far T Δc of merged lights is from that of all, relative RMSE.

    Args:
        lit, merged: points with lights. before, after: documents whose `curve` differs.
    """
    declared = TERMS[before["model"]].curve(curve)
    change = analysis(curve_bands(after, declared)) - analysis(curve_bands(before, declared))
    images = []
    for some in (merged, lit):
        frozen = freeze_along(some, before, curve)
        tiles, _, _, samples = frozen.transport.shape
        image = np.zeros((tiles, 3, samples), np.float32)
        frozen.add(change, image)
        images.append(image)
    return relative_rmse(*images)


def measure(tiny: bool) -> list[Figure]:
    """Freeze along both curves in turn."""
    term = cook_torrance(0.2)
    document = complete_term(("curve_switch",), term, None)
    lit = lit_teapot(document, tiny)
    curves = ("theta_h", "theta_d")
    merged = rough(lit)
    ways = [partial(freeze_along, some, document, curve) for curve in curves for some in (merged, lit)]
    names = [f"{curve}{which}_s" for curve in curves for which in ("", "_exact")]
    taken = in_turn(ways, 2 if tiny else 5)
    medians = {name: float(np.median(times)) for name, times in zip(names, taken, strict=True)}
    others = complete_term(("curve_switch",), {**term, "params": {"sigma": 0.3, "ior": 2.5}}, None)
    context = {
        **medians,
        **{f"{curve}_error": error_of_change(lit, merged, document, others, curve) for curve in curves},
        "merged_lights": merged.lights.num_lights,
        "view_samples": lit.points.num_points,
        "lights": lit.lights.num_lights,
        "visible_share": float(np.unpackbits(lit.receivers.visible).mean()),
        "threads": num_threads(),
    }
    return [Figure("freeze.curve_switch_s", max(medians[f"{curve}_s"] for curve in curves), "s", context)]
