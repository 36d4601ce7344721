"""The curves of a term along one parameter: what a slider runs through."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from relume.brdf.term import F64, Angle, Curve, Parameter, Term
from relume.math.angle_bands import MAX_ANGLE, band_averages

_FROM_A_PLANE = (Angle.ALPHA, Angle.BETA, Angle.TILT_X, Angle.TILT_Y)


def curves_of_parameter(term: Term, parameter: str) -> tuple[Curve, ...]:
    """The curves inside the transport that a parameter alone moves; those of the outgoing angle multiply finished
    samples, and what is fixed moves more than curves."""
    if parameter in term.fixed:
        return ()
    return tuple(curve for curve in term.curves if parameter in curve.parameters and not curve.depends_on_view)


def slider_values(parameter: Parameter, num: int, *, at_midpoints: bool = False) -> F64:
    """Values at even steps of a parameter's slider.

    Args:
        parameter: whose slider, with its range and scale.
        num: how many values.
        at_midpoints: whether to take the middles of `num` steps instead of the ends of `num` − 1 steps.
    Returns:
        (num,) float64
    """
    positions = (np.arange(num) + 0.5) / num if at_midpoints else np.linspace(0, 1, num)
    low, high = parameter.minimum, parameter.maximum
    if parameter.scale == "log":
        return np.asarray(low * (high / low) ** positions)
    return np.asarray(low + (high - low) * positions)


def curve_at_value(term: Term, curve: Curve, params: Mapping[str, float]) -> F64:
    """Band averages of one curve for given parameters.

    Args:
        term: whose curve, with the defaults of its parameters.
        curve: one of `term.curves`.
        params: values by the parameters' names; what is left out is at its default.
    Returns:
        (J,) float64
    """
    settings = {name: params.get(name, term.parameter(name).default) for name in curve.parameters}
    solid_angle_weighted = curve.angle.has_highlights
    return np.maximum(
        band_averages(
            lambda gamma: curve.generator(gamma, settings), curve.num_bands, solid_angle_weighted=solid_angle_weighted
        ),
        0,
    )


def solid_angles(curve: Curve) -> F64:
    """Share of all directions whose angle lies in each band, up to a factor. (J,)

    Directions are as dense at an angle as its sine; the angles along and across a tangent begin at a plane, not at a
    pole, and are evenly spread.
    """
    middle = (np.arange(curve.num_bands) + 0.5) * (MAX_ANGLE / curve.num_bands)
    return np.ones(curve.num_bands) if curve.angle in _FROM_A_PLANE else np.sin(middle)
