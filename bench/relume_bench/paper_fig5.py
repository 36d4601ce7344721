"""paper.fig5_*: incremental against standard non-linear approximation with 20 of 256 wavelet terms (Ben-Artzi, fig. 5).

The half-angle curve of a Cook–Torrance highlight, a sharp peak; the user draws a colored rise far from it, in so many
frames of a drag, then stops. Incremental: 20 coefficients per frame and channel, spent on the changes (eqs. 29 to 31).
Non-linear: the 20 largest coefficients of the curve. Error: of the image of that term, over its view samples. The
paper's figure is for its own scene: 4.8e-8 against 0.12.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.studio import studio
from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.strategies.operator import advance
from relume.look import BAKED_ENVIRONMENT, LightPaths
from relume.math.daubechies import analysis
from relume.operators.edit_basis import CurveBasis
from relume.operators.linear_operator import LinearOperator
from relume_bench.figure import Figure
from relume_bench.points import LitSamples, freeze_for_curve, sample_lit_surface
from relume_bench.scenes import LAMBERT, cook_torrance, teapot_on_table
from relume_bench.standard_error import estimate_point_error

F64 = NDArray[np.float64]

_BUDGET, _CURVE = 20, "theta_h"
_DRAG, _REST = 30, 12  # frames
_PEAK_DEG, _RISE = (20.0, 40.0, 62.0, 80.0), (0.6, 0.15, 0.05)  # start, peak and end of the rise; its RGB height


def measure(tiny: bool) -> list[Figure]:
    """Measure both errors on the same last frame."""
    num_positions, num_lights = (30, 200) if tiny else (4000, 2000)
    start = complete_term(("fig5",), cook_torrance(0.1), None)
    scene = teapot_on_table(studio(), (LAMBERT, start), (LAMBERT,))
    lit_samples = sample_lit_surface(scene, (320, 320), num_positions, num_lights, 0)
    operator = freeze_for_curve(lit_samples, start, _CURVE)
    frames = [_draw_curve(start, (k + 1) / _DRAG) for k in range(_DRAG)]
    bands = curve_bands(frames[-1], TERMS["cook_torrance"].curve(_CURVE))
    reference = _select_rows(_image(operator, analysis(bands)), num_positions)
    incremental = estimate_point_error(
        _select_rows(_render_drag(lit_samples, operator, start, frames), num_positions), reference
    )
    non_linear = estimate_point_error(
        _select_rows(_image(operator, _largest(analysis(bands))), num_positions), reference
    )
    context = {"terms": _BUDGET, "of": bands.shape[1], "drag_frames": _DRAG, "idle_frames": _REST}
    return [
        Figure("paper.fig5_incremental", incremental.value, "relative RMSE", context, incremental.standard_error),
        Figure("paper.fig5_non_linear", non_linear.value, "relative RMSE", context, non_linear.standard_error),
    ]


def _draw_curve(start: dict[str, Any], fraction: float) -> dict[str, Any]:
    """The generated curve with a fraction of the rise, as bands per channel."""
    bands = curve_bands(start, TERMS["cook_torrance"].curve(_CURVE))
    degrees = (np.arange(bands.shape[1]) + 0.5) * 90 / bands.shape[1]
    rise = np.interp(degrees, _PEAK_DEG, [0, 1, 0.4, 0])
    document = copy.deepcopy(start)
    document["curves"] = {_CURVE: {"bands": (bands + fraction * np.outer(_RISE, rise)).tolist()}}
    return document


def _render_drag(
    lit_samples: LitSamples, operator: LinearOperator, start: dict[str, Any], frames: list[dict[str, Any]]
) -> F64:
    """The term's image after the drag has converged."""
    curve = TERMS["cook_torrance"].curve(_CURVE)
    basis, light = CurveBasis.from_curve(curve), Illumination(BAKED_ENVIRONMENT, (), LightPaths(True, 1, 0))
    empty = DisplayedImage(np.zeros_like(operator.transport[:, :, 0]))
    summed_image = empty.evaluate_operator(operator, basis, {_CURVE: curve_bands(start, curve)}, light)
    for document in [*frames, *[frames[-1]] * _REST]:
        summed_image = advance(summed_image, {_CURVE: curve_bands(document, curve)}, operator, _BUDGET)
    return summed_image.image.astype(np.float64)


def _image(operator: LinearOperator, coefficients: F64) -> F64:
    """T · c in float64. (tiles, 3, samples)"""
    return np.asarray(np.einsum("tcjs,cj->tcs", operator.transport.astype(np.float64), coefficients, optimize=True))


def _select_rows(image: F64, num_positions: int) -> F64:
    """Samples of an image in tiles, (tiles, 3, samples), one per row. (n, 3)"""
    return image.transpose(0, 2, 1).reshape(-1, 3)[:num_positions]


def _largest(coefficients: F64) -> F64:
    """The coefficients, all but the largest of each channel set to zero."""
    truncated = np.zeros_like(coefficients)
    index = np.argsort(-np.abs(coefficients), axis=1)[:, :_BUDGET]
    np.put_along_axis(truncated, index, np.take_along_axis(coefficients, index, axis=1), axis=1)
    return truncated
