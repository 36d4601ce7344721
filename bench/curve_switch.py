"""freeze.curve_switch_s: what a user waits who touches another curve of a two-curve term.

17,700 view samples of the teapot × 4,000 light triangles, cook_torrance; the operator along θh (256 bands, θd
contracted) and the one along θd (64 bands, θh contracted). The larger of the two medians counts.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from bench.figure import Figure
from bench.points import freeze_along, lit_points
from bench.scenes import cook_torrance, teapot_on_table
from bench.timing import in_turn
from relume.environments.studio import studio
from relume.look.terms import complete_term
from relume.parallel import num_threads


def measure(tiny: bool) -> list[Figure]:
    """Freeze along both curves in turn."""
    num_points, num_lights, size = (100, 200, (64, 64)) if tiny else (17_700, 4000, (320, 320))
    document = complete_term(("curve_switch",), cook_torrance(0.2), None)
    scene = teapot_on_table(studio(), (document,), (document,))
    lit = lit_points(scene, size, num_points, num_lights, material=0)
    curves = ("theta_h", "theta_d")
    taken = in_turn([partial(freeze_along, lit, document, curve) for curve in curves], 2 if tiny else 5)
    medians = {f"{curve}_s": float(np.median(times)) for curve, times in zip(curves, taken, strict=True)}
    context = {
        **medians,
        "view_samples": lit.points.num_points,
        "lights": lit.lights.num_lights,
        "visible_share": float(np.unpackbits(lit.receivers.visible).mean()),
        "threads": num_threads(),
    }
    return [Figure("freeze.curve_switch_s", max(medians.values()), "s", context)]
