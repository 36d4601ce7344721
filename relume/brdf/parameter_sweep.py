"""Curves of a term along one parameter, over the range of its slider."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Shaped

from relume.brdf.term import F64, Angle, Curve, Parameter, Term
from relume.math.angle_bands import MAX_ANGLE, band_averages

_FROM_A_PLANE = (Angle.ALPHA, Angle.BETA, Angle.TILT_X, Angle.TILT_Y)


def curves_of_parameter(term: Term, parameter: str) -> tuple[Curve, ...]:
    """Curves of the transport that a parameter affects; empty for a fixed parameter, which affects more than curves.

    Excludes curves of the view angle, which multiply finished samples.
    """
    if parameter in term.fixed:
        return ()
    return tuple(curve for curve in term.curves if parameter in curve.parameters and not curve.depends_on_view)


def slider_values(parameter: Parameter, num: int, *, at_midpoints: bool = False) -> Shaped[F64, " num"]:
    """Parameter values at equal steps of its slider.

    Args:
        parameter: parameter with its range and scale.
        num: number of values.
        at_midpoints: use the midpoints of `num` steps instead of the ends of `num` − 1 steps.
    """
    positions = (np.arange(num) + 0.5) / num if at_midpoints else np.linspace(0, 1, num)
    low, high = parameter.minimum, parameter.maximum
    if parameter.scale == "log":
        return np.asarray(low * (high / low) ** positions)
    return np.asarray(low + (high - low) * positions)


def curve_at_value(term: Term, curve: Curve, params: Mapping[str, float]) -> Shaped[F64, " J"]:
    """Band averages of one curve for given parameters.

    Args:
        term: the curve's term, with the defaults of its parameters.
        curve: one of `term.curves`.
        params: values by parameter name; missing parameters have their defaults.
    """
    settings = {name: params.get(name, term.parameter(name).default) for name in curve.parameters}
    solid_angle_weighted = curve.angle.has_highlights
    return np.maximum(
        band_averages(
            lambda gamma: curve.generator(gamma, settings), curve.num_bands, solid_angle_weighted=solid_angle_weighted
        ),
        0,
    )


def solid_angles(curve: Curve) -> Shaped[F64, " J"]:
    """Solid angle of each band, up to a common factor.

    The density of directions at an angle is its sine; the angles along and across a tangent start at a plane, not at a
    pole, and are uniformly distributed.
    """
    middle = (np.arange(curve.num_bands) + 0.5) * (MAX_ANGLE / curve.num_bands)
    return np.ones(curve.num_bands) if curve.angle in _FROM_A_PLANE else np.sin(middle)
