"""freeze.terms_s: `freeze.curve_switch_s` for every curve of every analytic term; the longest, all in the context.

Parameters as in `relume_bench.accuracy_terms`. One warm-up round each, which compiles, then one that counts.
"""

from __future__ import annotations

from functools import partial

from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.core.thread_pools import num_threads
from relume_bench.accuracy_terms import CASES
from relume_bench.curve_switch import lit_teapot, merge_lights
from relume_bench.figure import Figure
from relume_bench.points import freeze_for_curve
from relume_bench.scenes import LAMBERT
from relume_bench.timing import time_interleaved


def measure(tiny: bool) -> list[Figure]:
    """Time the freeze of each curve."""
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
