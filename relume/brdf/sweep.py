"""The curves of a term along one parameter: what a slider runs through."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from relume.basis.bands import band_averages
from relume.brdf.term import F64, Curve, Parameter, Term


def moved_curves(term: Term, parameter: str) -> tuple[Curve, ...]:
    """The curves inside the transport that read a parameter; those of the outgoing angle multiply finished samples."""
    return tuple(curve for curve in term.curves if parameter in curve.parameters and not curve.outgoing)


def slider_values(parameter: Parameter, num: int, *, between: bool = False) -> F64:
    """Values at even steps of the slider, ends included; `between`, those in the middle of such steps. (num,)"""
    at = (np.arange(num) + 0.5) / num if between else np.linspace(0, 1, num)
    low, high = parameter.minimum, parameter.maximum
    if parameter.scale == "log":
        return np.asarray(low * (high / low) ** at)
    return np.asarray(low + (high - low) * at)


def bands_at(term: Term, curve: Curve, params: Mapping[str, float]) -> F64:
    """Band averages of one curve, what `params` leaves out at its default. (J,)"""
    settings = {name: params.get(name, term.parameter(name).default) for name in curve.parameters}
    return np.maximum(band_averages(lambda gamma: curve.generator(gamma, settings), curve.num_bands), 0)
