"""freeze.curve_switch_s: what a user waits who touches another curve of a two-curve term.

17,700 view samples of the teapot × 4,000 light triangles, cook_torrance; the operator along θh (256 bands, θd
contracted) and the one along θd (64 bands, θh contracted). The larger of the two medians counts.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from bench.figure import Figure
from bench.points import Lit, freeze_along, lit_points
from bench.scenes import cook_torrance, teapot_on_table
from bench.timing import in_turn
from relume.brdf.document import complete_term
from relume.environments.studio import studio
from relume.parallel import num_threads


def lit_teapot(term: dict[str, Any], tiny: bool) -> Lit:
    """View samples of a teapot, all of one term, with their light triangles and what they see of them."""
    num_points, num_lights, size = (100, 200, (64, 64)) if tiny else (17_700, 4000, (320, 320))
    return lit_points(teapot_on_table(studio(), (term,), (term,)), size, num_points, num_lights, material=0)


def measure(tiny: bool) -> list[Figure]:
    """Freeze along both curves in turn."""
    document = complete_term(("curve_switch",), cook_torrance(0.2), None)
    lit = lit_teapot(document, tiny)
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
