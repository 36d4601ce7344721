"""Curves of a term in a look document: generated from parameters, or drawn freehand per color channel.

Freehand curves are {"points": [[degrees, value], ...]}, monotone cubic between (Fritsch & Carlson 1980) and constant
outside, or {"bands": J or 3 × J values}, or relative to these or to the generated curve, see `relume.brdf.curve_edits`;
"channels" selects some of "rgb". `relume.look` validates documents.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Shaped
from scipy.interpolate import PchipInterpolator, PPoly

from relume.brdf.curve_edits import curve_edit, drawn_curves, evaluate_edit, is_relative
from relume.brdf.registry import TERMS
from relume.brdf.term import F64, Curve, Params
from relume.math.angle_bands import MAX_ANGLE, band_averages, band_edges

CHANNELS = "rgb"
SLOPE_VARIANCE = "slope_variance"
"""Entry of a term document at a roughness level: variance of normals within a pixel; never in looks."""


def channel_params(term_document: Mapping[str, Any], curve: Curve) -> list[dict[str, float]]:
    """Parameters that `curve` reads, for R, G and B; missing parameters have their defaults. See `SLOPE_VARIANCE`."""
    term = TERMS[term_document["model"]]
    given = term_document.get("params") or {}
    values = {name: given.get(name, term.parameter(name).default) for name in curve.parameters}
    if SLOPE_VARIANCE in term_document and term.width is not None and term.width[0] in curve.parameters:
        values[SLOPE_VARIANCE] = term_document[SLOPE_VARIANCE]
    return [
        {name: float(value if isinstance(value, int | float) else value[k]) for name, value in values.items()}
        for k in range(3)
    ]


@lru_cache(maxsize=1024)
def _generate_bands(model: str, curve_name: str, params: tuple[tuple[str, float], ...]) -> F64:
    curve = TERMS[model].curve(curve_name)
    settings: Params = dict(params)
    solid_angle_weighted = curve.angle.has_highlights
    bands = band_averages(
        lambda gamma: curve.generator(gamma, settings), curve.num_bands, solid_angle_weighted=solid_angle_weighted
    )
    np.maximum(bands, 0.0, out=bands)  # quadrature may undershoot where a curve vanishes
    bands.flags.writeable = False
    return bands


@lru_cache(maxsize=64)
def _data_bands(factor: Callable[[F64], F64], num_bands: int, solid_angle_weighted: bool) -> F64:
    """Band averages of a measured curve. (3, J)"""

    def average(channel: int) -> F64:
        return band_averages(
            lambda gamma: np.asarray(factor(gamma)[channel]), num_bands, solid_angle_weighted=solid_angle_weighted
        )

    return np.stack([average(channel) for channel in range(3)])


def generated_bands(term_document: Mapping[str, Any], curve: Curve) -> Shaped[F64, "3 J"]:
    """Band averages, not negative, of the curve that the parameters or data generate, without freehand edits."""
    if curve.factor is not None:
        return _data_bands(curve.factor, curve.num_bands, curve.angle.has_highlights).copy()
    model = term_document["model"]
    return np.stack(
        [_generate_bands(model, curve.name, tuple(p.items())) for p in channel_params(term_document, curve)]
    )


def _channels(drawn: Mapping[str, Any]) -> Iterator[int]:
    return (CHANNELS.index(channel) for channel in drawn.get("channels", CHANNELS))


def _drawn_bands(drawn: Mapping[str, Any], num_bands: int) -> F64:
    """Broadcast one list for all channels, three lists of J, or 3·J flat values to (3, J)."""
    return np.broadcast_to(np.asarray(drawn["bands"], dtype=np.float64).reshape(-1, num_bands), (3, num_bands))


def _control_points(drawn: Mapping[str, Any]) -> tuple[F64, PchipInterpolator]:
    points = np.asarray(drawn["points"], dtype=np.float64)
    gamma = np.radians(points[:, 0])
    return gamma, PchipInterpolator(gamma, points[:, 1])


def _spline_averages(drawn: Mapping[str, Any], curve: Curve) -> F64:
    """Exact band averages of a drawn curve, from its antiderivative, weighted like those of generated curves."""
    gamma, spline = _control_points(drawn)
    edges = band_edges(curve.num_bands)
    power = 2 if curve.angle.has_highlights else 1
    integral = (_times_angle(spline) if power == 2 else spline).antiderivative()
    inside = np.clip(edges, gamma[0], gamma[-1])
    # constant outside the first and last point
    outside = (edges**power - inside**power) / power * np.where(edges < gamma[0], spline(gamma[0]), spline(gamma[-1]))
    return np.asarray(np.diff(integral(inside) + outside) * power / np.diff(edges**power))


def _times_angle(spline: PPoly) -> PPoly:
    """γ f(γ) of a piecewise cubic f."""
    coefficients = np.zeros((len(spline.c) + 1, spline.c.shape[1]))
    coefficients[:-1] += spline.c
    coefficients[1:] += spline.c * spline.x[:-1]
    return PPoly(coefficients, spline.x)


def _base_bands(drawn: Mapping[str, Any], curve: Curve, generated: F64) -> F64:
    """Base of an object's relative edits: its points, its bands, or the generated curve. (3, J)"""
    if "points" in drawn:
        return np.broadcast_to(_spline_averages(drawn, curve), generated.shape)
    return _drawn_bands(drawn, generated.shape[1]) if "bands" in drawn else generated


def curve_bands(term_document: Mapping[str, Any], curve: Curve) -> Shaped[F64, "3 J"]:
    """Band averages, not negative, of the displayed curve: drawn where there are freehand objects, else generated.

    Args:
        term_document: one term of a complete look: model, params, curves.
        curve: one of that model's curves.
    """
    bands = generated_bands(term_document, curve)
    for drawn in drawn_curves(term_document, curve):
        values = np.maximum(_base_bands(drawn, curve, bands), 0.0)
        if is_relative(drawn):
            factor, offset = curve_edit(drawn, values)
            # blended handles that reach zero cancel up to rounding
            values = np.maximum(factor * values + offset, 0.0)
        for channel in _channels(drawn):
            bands[channel] = values[channel]
    return bands


def curve_values(term_document: Mapping[str, Any], curve: Curve, gamma: F64) -> Shaped[F64, "3 ..."]:
    """Evaluate the displayed curve, not negative, at exact angles; a curve given as bands is constant in each band.

    Args:
        term_document: one term of a complete look: model, params, curves.
        curve: one of the term's curves.
        gamma: radians in [0, π/2]. (...)
    """
    if curve.factor is not None:
        values = np.array(curve.factor(gamma))
    else:
        params_per_channel = channel_params(term_document, curve)
        first = curve.generator(gamma, params_per_channel[0])
        remaining = (
            first if params == params_per_channel[0] else curve.generator(gamma, params)
            for params in params_per_channel[1:]
        )
        values = np.stack([first, *remaining])
    for drawn in drawn_curves(term_document, curve):
        exact = _base_values(drawn, values, gamma, curve.num_bands)
        if is_relative(drawn):
            base = np.maximum(_base_bands(drawn, curve, generated_bands(term_document, curve)), 0.0)
            # a factor of the finished pixel is never averaged over bands, so steps between bands would be visible
            factor, offset = (
                evaluate_edit(rows, gamma, MAX_ANGLE, smooth=curve.depends_on_view) for rows in curve_edit(drawn, base)
            )
            exact = factor * exact + offset
        for channel in _channels(drawn):
            values[channel] = exact[channel]
    return np.maximum(values, 0.0)


def _base_values(drawn: Mapping[str, Any], generated: F64, gamma: F64, num_bands: int) -> F64:
    """`_base_bands` at exact angles. (3, ...)"""
    if "points" in drawn:
        ends, spline = _control_points(drawn)
        return np.broadcast_to(spline(np.clip(gamma, ends[0], ends[-1])), generated.shape)
    if "bands" in drawn:
        return evaluate_edit(_drawn_bands(drawn, num_bands), gamma, MAX_ANGLE, smooth=False)
    return generated
