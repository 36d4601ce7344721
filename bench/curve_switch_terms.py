"""freeze.terms_s: `freeze.curve_switch_s` for every curve of every analytic term; the longest, all of them in the row.

Parameters are those of `bench.accuracy_terms`. One uncounted round each, which compiles, then one that counts.
"""

from __future__ import annotations

from functools import partial

from bench.accuracy_terms import CASES
from bench.curve_switch import lit_teapot, rough
from bench.figure import Figure
from bench.points import freeze_along
from bench.scenes import LAMBERT
from bench.timing import in_turn
from relume.brdf.document import complete_term
from relume.brdf.registry import TERMS
from relume.parallel import num_threads


def measure(tiny: bool) -> list[Figure]:
    """Time the freeze of one curve after another."""
    documents = [complete_term(("curve_switch",), term, None) for term in (LAMBERT, *(term for _, term, _ in CASES))]
    lit = lit_teapot(documents[0], tiny)
    merged, taken = rough(lit), {}
    for document in documents:
        for curve in (curve.name for curve in TERMS[document["model"]].curves if not curve.outgoing):
            (seconds,) = in_turn([partial(freeze_along, merged, document, curve)], 1)
            taken[f"{document['model']} {curve}"] = min(seconds)
    sizes = {"view_samples": lit.points.num_points, "lights": lit.lights.num_lights, "threads": num_threads()}
    return [Figure("freeze.terms_s", max(taken.values()), "s", {**taken, **sizes})]
