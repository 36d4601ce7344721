"""pca.*: number of vectors that represent the curves of a parameter (Nguyen 2010, section 4 and figure 5).

Norm of `pca.blinn_phong_6`: √mean (linearized − exact)² ÷ √mean exact² over all bands and values of the parameter, the
exponent evenly spaced over [3, 300] as in the paper, 256 bands; decomposed at 298 values, measured at those between.
`pca.vectors` is the largest number of vectors, over all terms and sliders, that keeps this norm at 1e-3; its context
has the errors of each slider with 2 to 16 vectors: over all values, and at the worst value. `pca.slider_nodes` is the
largest number of nodes of an operator along a slider (`relume.operators.parameter_operator`), all in the context.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.brdf.parameter_sweep import curve_at_value, curves_of_parameter, slider_values
from relume.brdf.registry import TERMS
from relume.brdf.term import F64, Parameter, Term
from relume.math.pca import decompose, joint, relative_rms, worst_relative_rms
from relume.operators.parameter_operator import linearize
from relume_bench.figure import Figure

_NUM_VECTORS = (2, 4, 6, 8, 10, 12, 16)
_BOUND = 1e-3


def measure(tiny: bool) -> list[Figure]:
    """The paper's curve first, then every slider of every term."""
    num = 12 if tiny else 129
    exponent = replace(TERMS["blinn_phong"].parameter("exponent"), minimum=3.0, maximum=300.0, scale="linear")
    paper = _errors(TERMS["blinn_phong"], exponent, 12 if tiny else 298)
    needed, context = 0, {}
    for term in TERMS.values():
        for parameter in term.parameters:
            if not curves_of_parameter(term, parameter.name):
                continue
            errors = _errors(term, parameter, num)
            enough = [k for k, (overall, _) in errors.items() if overall <= _BOUND]
            needed = max(needed, min(enough, default=_NUM_VECTORS[-1] + 1))
            context[f"{term.model}.{parameter.name}"] = _describe(errors)
    return [
        Figure("pca.blinn_phong_6", paper[6][0], "relative RMS", {"errors": _describe(paper)}),
        Figure("pca.vectors", needed, "vectors", context),
        _count_nodes([TERMS["lambert"], TERMS["cook_torrance"]] if tiny else list(TERMS.values())),
    ]


def _count_nodes(terms: list[Term]) -> Figure:
    """Nodes of every slider; "bands" if too many would be needed."""
    num_nodes: dict[str, int | str] = {}
    for term in terms:
        for parameter in term.parameters:
            if curves_of_parameter(term, parameter.name):
                linearised = linearize({"model": term.model, "params": {}}, parameter.name)
                num_nodes[f"{term.model}.{parameter.name}"] = "bands" if linearised is None else linearised.num_columns
    return Figure("pca.slider_nodes", max(n for n in num_nodes.values() if isinstance(n, int)), "nodes", num_nodes)


def _errors(term: Term, parameter: Parameter, num: int) -> dict[int, tuple[float, float]]:
    """Error over all values, and at the worst one, by number of vectors."""
    components = decompose(_curves(term, parameter, slider_values(parameter, num)))
    exact = _curves(term, parameter, slider_values(parameter, num - 1, at_midpoints=True))
    errors = {}
    for k in _NUM_VECTORS:
        truncated = components.first(k)
        approximation = truncated.synthesis(truncated.analysis(exact))
        errors[k] = relative_rms(approximation, exact), worst_relative_rms(approximation, exact)
    return errors


def _curves(term: Term, parameter: Parameter, values: F64) -> F64:
    """Product of all curves that a parameter changes. (values, J)"""
    curves = curves_of_parameter(term, parameter.name)
    return np.array(
        [joint([curve_at_value(term, curve, {parameter.name: value}) for curve in curves]) for value in values]
    )


def _describe(errors: dict[int, tuple[float, float]]) -> str:
    return ", ".join(f"{k}: {overall:.1e} ({worst:.1e})" for k, (overall, worst) in errors.items())
