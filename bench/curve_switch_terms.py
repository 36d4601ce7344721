"""freeze.terms_s: `freeze.curve_switch_s` for every curve of every analytic term; the longest, all of them in the row.

Parameters are those of `bench.accuracy_terms`. One uncounted round each, which compiles, then one that counts.
"""

from __future__ import annotations

from functools import partial

from bench.accuracy_terms import CASES
from bench.curve_switch import lit_teapot, merge_lights
from bench.figure import Figure
from bench.points import freeze_for_curve
from bench.scenes import LAMBERT
from bench.timing import time_interleaved
from relume.brdf.document import complete_term
from relume.brdf.registry import TERMS
from relume.parallel import num_threads


def measure(tiny: bool) -> list[Figure]:
    """Time the freeze of one curve after another."""
    documents = [complete_term(("curve_switch",), term, None) for term in (LAMBERT, *(term for _, term, _ in CASES))]
    lit_samples = lit_teapot(documents[0], tiny)
    merged, durations = merge_lights(lit_samples), {}
    for document in documents:
        for curve in (curve.name for curve in TERMS[document["model"]].curves if not curve.depends_on_view):
            (seconds,) = time_interleaved([partial(freeze_for_curve, merged, document, curve)], 1)
            durations[f"{document['model']} {curve}"] = min(seconds)
    sizes = {
        "view_samples": lit_samples.surface_points.num_points,
        "lights": lit_samples.lights.num_lights,
        "threads": num_threads(),
    }
    return [Figure("freeze.terms_s", max(durations.values()), "s", {**durations, **sizes})]
