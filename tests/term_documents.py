"""Random terms of looks, from the declarations in the registry of terms."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from relume.brdf.registry import TERMS
from relume.brdf.term import Curve, Parameter

SEEDS = st.integers(0, 2**32 - 1)
COLORS = st.lists(st.floats(0.0, 4.0), min_size=3, max_size=3)


def slider_values(parameter: Parameter) -> SearchStrategy[float]:
    """Values of a parameter, uniform on its slider."""
    low, high = parameter.minimum, parameter.maximum
    if parameter.step is not None:
        return st.integers(round(low / parameter.step), round(high / parameter.step)).map(
            lambda k: k * (parameter.step or 1)
        )
    logarithmic = parameter.scale == "log"
    return st.floats(0.0, 1.0).map(
        lambda t: min(max(low * (high / low) ** t if logarithmic else low + t * (high - low), low), high)
    )


def params(model: str, *, one_value: bool = False) -> SearchStrategy[dict[str, Any]]:
    """All parameters of a model, with one value or one for each channel.

    Args:
        one_value: never a value for each channel.
    """
    term = TERMS[model]

    def values(parameter: Parameter) -> SearchStrategy[Any]:
        one = slider_values(parameter)
        return (
            one if one_value or parameter.name in term.fixed else st.one_of(one, st.lists(one, min_size=3, max_size=3))
        )

    return st.fixed_dictionaries({parameter.name: values(parameter) for parameter in term.parameters})


_NUMBERS = st.integers(0, 10**6).map(lambda k: k / 1e4)  # of numbers near 1e-308 splines overflow
_ANGLES = st.lists(st.integers(0, 9000).map(lambda k: k / 100), min_size=2, max_size=6, unique=True).map(sorted)


def _rows(num_values: int) -> SearchStrategy[list[list[float]]]:
    """Rows of an increasing angle in degrees and some values."""
    values = st.lists(_NUMBERS, min_size=num_values, max_size=num_values)
    return _ANGLES.flatmap(lambda angles: st.tuples(*(values.map(lambda row, x=x: [x, *row]) for x in angles))).map(
        list
    )


points = _rows(1)
handles = _rows(2)


def drawn_curves(curve: Curve) -> SearchStrategy[Any]:
    """A freehand object of a curve, or one object for some channels and one for the others."""
    # a few levels, each for a run of bands: long lists of random numbers would be slow
    levels = st.lists(_NUMBERS, min_size=4, max_size=4)
    bands = levels.map(lambda values: [value for value in values for _ in range(curve.num_bands // 4)])
    drawn = st.one_of(
        st.fixed_dictionaries({"points": points}, optional={"handles": handles}),
        st.fixed_dictionaries({"bands": bands}, optional={"factors": bands}),
        st.fixed_dictionaries({"handles": handles}),
        st.fixed_dictionaries({"factors": bands}, optional={"offsets": bands, "handles": handles}),
    )
    one_channel = drawn.map(lambda item: {**item, "channels": "g"})
    two_objects = st.tuples(drawn, drawn).map(
        lambda pair: [{**pair[0], "channels": "br"}, {**pair[1], "channels": "g"}]
    )
    return st.one_of(drawn, one_channel, two_objects)


def terms(model: str, *, data: str | None = None) -> SearchStrategy[dict[str, Any]]:
    """A term of a look with random color, parameters and freehand curves.

    Args:
        data: the name of its data, for a model that needs some.
    """
    drawn = {curve.name: drawn_curves(curve) for curve in TERMS[model].curves}
    return st.fixed_dictionaries(
        {
            "model": st.just(model),
            **({"data": st.just(data)} if data is not None else {}),
            "color": COLORS,
            "params": params(model),
            "curves": st.fixed_dictionaries({}, optional=drawn),
        }
    )
