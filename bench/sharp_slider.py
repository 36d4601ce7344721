"""slider.sharp_*: what a hand sees while a highlight is dragged through the sharpest tenth of its slider.

Samples of the teapot, in real light; its highlight alone, by the nodes of the slider (`relume.operators.nodes`), at
values between those that nodes were chosen from, against the same shaded. `slider.sharp_error`: the largest error of a
sample, as a share of itself and of a hundredth of what it would show if the highlight were spread evenly over its
angle. `slider.sharp_levels`: the largest after the tone map `agx`, the brightest twentieth white, of 255. The context
has both for each light and slider, with the 99th percentile and the share of samples that are below zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.figure import Figure
from bench.points import Lit, lit_points
from bench.scenes import LAMBERT, environments, teapot_on_table
from relume.brdf.curves import curve_bands
from relume.brdf.document import complete_term
from relume.brdf.registry import TERMS
from relume.brdf.sweep import moved_curves, slider_values, solid_angles
from relume.brdf.term import F64
from relume.imageio.tonemap import tone_map
from relume.operators.nodes import Linearised, linearise
from relume.project.contraction import contract
from relume.project.projector import Projector

_SLIDERS = (("ggx", "roughness"), ("cook_torrance", "sigma"), ("blinn_phong", "exponent"))


def measure(tiny: bool) -> list[Figure]:
    """Measure every slider under every light."""
    num_points, num_lights, size = (60, 80, (32, 32)) if tiny else (4000, 2000, (160, 160))
    found = {}
    for environment in environments()[: 1 if tiny else 3]:
        scene = teapot_on_table(environment, (LAMBERT,), (LAMBERT,))
        lit = lit_points(scene, size, num_points, num_lights, material=0)
        for model, parameter in _SLIDERS:
            found[f"{environment.name}, {model}.{parameter}"] = _errors(lit, model, parameter, 2 if tiny else 12)
    worst = {name: max(errors[name] for errors in found.values()) for name in ("largest", "levels")}
    return [
        Figure("slider.sharp_error", worst["largest"], "share", {"view_samples": num_points, **found}),
        Figure("slider.sharp_levels", worst["levels"], "of 255", {"view_samples": num_points}),
    ]


def _errors(lit: Lit, model: str, parameter: str, num: int) -> dict[str, float]:
    """Over values in the sharpest tenth, of which exponents have theirs at the upper end."""
    declared = TERMS[model].parameter(parameter)
    values = slider_values(declared, 10 * num, between=True)
    tenth = values[-num:] if parameter == "exponent" else values[:num]
    first = complete_term(("slider",), {"model": model, "params": {parameter: float(values[0])}}, None)
    along = linearise(first, parameter)
    if along is None:
        raise ValueError(f"{parameter} of {model} has no nodes")
    term = TERMS[model]
    progress, cancelled = (lambda share: None), (lambda: False)
    frozen = along.freeze(term, _bands(first), lit.lights, lit.receivers, progress, cancelled)
    shares, levels, negative = [], [], []
    for value in tenth:
        document = {**first, "params": {**first["params"], parameter: float(value)}}
        exact = _shaded(lit, document, _bands(document))
        even = _shaded(lit, document, _spread(along, _bands(document)))
        tiles, _, _, samples = frozen.transport.shape
        image = np.zeros((tiles, 3, samples), np.float32)
        frozen.add(along.coefficients(_bands(document)), image)
        shown = image.transpose(0, 2, 1).reshape(-1, 3)[: lit.points.num_points].astype(np.float64)
        shares.append(np.abs(shown - exact) / (exact + 0.01 * even + 1e-12))
        negative.append(float((shown < -0.01 * even).any(axis=1).mean()))
        exposure = -float(np.log2(max(np.percentile(exact, 95), 1e-9)))
        display = [tone_map(rows[None].astype(np.float32), exposure, "agx")[0] for rows in (shown, exact)]
        levels.append(255 * np.abs(display[0].astype(np.float64) - display[1]))
    return {
        "largest": float(np.max(shares)),
        "percentile_99": float(np.percentile(shares, 99)),
        "levels": float(np.max(levels)),
        "levels_99": float(np.percentile(levels, 99)),
        "negative_share": max(negative),
        "nodes": along.num_columns,
    }


def _bands(document: dict[str, Any]) -> dict[str, F64]:
    curves = TERMS[document["model"]].curves
    return {curve.name: curve_bands(document, curve) for curve in curves if not curve.outgoing}


def _spread(along: Linearised, bands: dict[str, F64]) -> dict[str, F64]:
    """The curves that a slider moves, each spread evenly over all directions."""
    spread = dict(bands)
    for curve in moved_curves(TERMS[along.model], along.parameter):
        share = solid_angles(curve) / solid_angles(curve).sum()
        spread[curve.name] = np.repeat((bands[curve.name] @ share)[:, None], curve.num_bands, axis=1)
    return spread


def _shaded(lit: Lit, document: dict[str, Any], bands: dict[str, F64]) -> F64:
    """All curves contracted. (n, 3)"""
    term = TERMS[document["model"]].settled(document)
    projector = Projector(term, contract(term, bands, None), lit.lights, lit.receivers)
    return projector.project(0, lit.points.num_points)[:, 0].astype(np.float64)
