"""slider.sharp_*: error while a highlight is dragged through the sharpest tenth of its slider.

Samples of the teapot, in real light; its highlight alone, by the nodes of the slider
(`relume.operators.parameter_operator`), at values between those from which nodes were chosen, against the same shaded.
`slider.sharp_error`: the largest error of a sample, relative to itself plus a hundredth of its value for a highlight
spread evenly over its angle. `slider.sharp_levels`: the largest after the tone map `agx`, with the brightest twentieth
white, of 255. The context has both for each light and slider, with the 99th percentile and the fraction of negative
samples.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from relume.brdf.curves import curve_bands
from relume.brdf.parameter_sweep import curves_of_parameter, slider_values, solid_angles
from relume.brdf.registry import TERMS
from relume.brdf.term import F64
from relume.brdf.term_validation import complete_term
from relume.image_io.tone_mapping import tone_map
from relume.operators.edit_basis import precompute
from relume.operators.parameter_operator import ParameterOperator, linearize
from relume.transport.projector import Projector
from relume.transport.term_contraction import contract
from relume_bench.figure import Figure
from relume_bench.points import LitSamples, sample_lit_surface
from relume_bench.scenes import LAMBERT, environments, teapot_on_table

_SLIDERS = (("ggx", "roughness"), ("cook_torrance", "sigma"), ("blinn_phong", "exponent"))


def measure(tiny: bool) -> list[Figure]:
    """Measure every slider under every light."""
    num_positions, num_lights, size = (60, 80, (32, 32)) if tiny else (4000, 2000, (160, 160))
    errors_by_name = {}
    for environment in environments()[: 1 if tiny else 3]:
        scene = teapot_on_table(environment, (LAMBERT,), (LAMBERT,))
        lit_samples = sample_lit_surface(scene, size, num_positions, num_lights, material=0)
        for model, parameter in _SLIDERS:
            errors_by_name[f"{environment.name}, {model}.{parameter}"] = _errors(
                lit_samples, model, parameter, 2 if tiny else 12
            )
    worst = {name: max(errors[name] for errors in errors_by_name.values()) for name in ("largest", "levels")}
    return [
        Figure("slider.sharp_error", worst["largest"], "share", {"view_samples": num_positions, **errors_by_name}),
        Figure("slider.sharp_levels", worst["levels"], "of 255", {"view_samples": num_positions}),
    ]


def _errors(lit_samples: LitSamples, model: str, parameter: str, num: int) -> dict[str, float]:
    """Errors over values in the sharpest tenth, for exponents at the upper end."""
    declared = TERMS[model].parameter(parameter)
    values = slider_values(declared, 10 * num, at_midpoints=True)
    tenth = values[-num:] if parameter == "exponent" else values[:num]
    first = complete_term(("slider",), {"model": model, "params": {parameter: float(values[0])}}, None)
    along = linearize(first, parameter)
    if along is None:
        raise ValueError(f"{parameter} of {model} has no nodes")
    term = TERMS[model]
    progress, is_canceled = (lambda share: None), (lambda: False)
    operator = precompute(along, term, _bands(first), lit_samples.lights, lit_samples.receivers, progress, is_canceled)
    energy_fractions, noise_levels, negative = [], [], []
    for value in tenth:
        document = {**first, "params": {**first["params"], parameter: float(value)}}
        exact = _shade(lit_samples, document, _bands(document))
        uniform = _shade(lit_samples, document, _spread(along, _bands(document)))
        tiles, _, _, samples = operator.transport.shape
        image = np.zeros((tiles, 3, samples), np.float32)
        operator.add(along.coefficients(_bands(document)), image)
        radiance = image.transpose(0, 2, 1).reshape(-1, 3)[: lit_samples.surface_points.num_points].astype(np.float64)
        energy_fractions.append(np.abs(radiance - exact) / (exact + 0.01 * uniform + 1e-12))
        negative.append(float((radiance < -0.01 * uniform).any(axis=1).mean()))
        exposure = -float(np.log2(max(np.percentile(exact, 95), 1e-9)))
        display = [tone_map(rows[None].astype(np.float32), exposure, "agx")[0] for rows in (radiance, exact)]
        noise_levels.append(255 * np.abs(display[0].astype(np.float64) - display[1]))
    return {
        "largest": float(np.max(energy_fractions)),
        "percentile_99": float(np.percentile(energy_fractions, 99)),
        "levels": float(np.max(noise_levels)),
        "levels_99": float(np.percentile(noise_levels, 99)),
        "negative_fraction": max(negative),
        "nodes": along.num_columns,
    }


def _bands(document: dict[str, Any]) -> dict[str, F64]:
    curves = TERMS[document["model"]].curves
    return {curve.name: curve_bands(document, curve) for curve in curves if not curve.depends_on_view}


def _spread(along: ParameterOperator, bands: dict[str, F64]) -> dict[str, F64]:
    """The curves that a slider changes, each spread evenly over all directions."""
    spread = dict(bands)
    for curve in curves_of_parameter(TERMS[along.model], along.parameter):
        weights = solid_angles(curve) / solid_angles(curve).sum()
        spread[curve.name] = np.repeat((bands[curve.name] @ weights)[:, None], curve.num_bands, axis=1)
    return spread


def _shade(lit_samples: LitSamples, document: dict[str, Any], bands: dict[str, F64]) -> F64:
    """All curves contracted. (n, 3)"""
    term = TERMS[document["model"]].normalized(document)
    projector = Projector(term, contract(term, bands, None), lit_samples.lights, lit_samples.receivers)
    return projector.project(0, lit_samples.surface_points.num_points)[:, 0].astype(np.float64)
