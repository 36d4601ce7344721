"""Random valid edits of the look in `example_look`, as partial documents."""

from __future__ import annotations

from typing import Any

from analytic_terms import ANALYTIC
from example_look import MATERIALS
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from term_documents import COLORS, terms

_COORDINATES = st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3)
_DIRECTIONS = _COORDINATES.filter(lambda direction: max(map(abs, direction)) > 1e-3)
_DEGREES = st.floats(-360.0, 360.0)
_BRIGHTNESS: dict[str, SearchStrategy[Any]] = {
    "intensity": st.floats(0.0, 10.0),
    "color": COLORS,
    "enabled": st.booleans(),
    "emission": COLORS,
}
_LENGTHS = st.floats(0.01, 10.0)
_SIZES = st.lists(st.floats(0.01, 10.0), min_size=2, max_size=2)
_CONES = st.lists(st.floats(1.0, 90.0), min_size=2, max_size=2).map(sorted)


def _light(kind: str, **fields: SearchStrategy[Any]) -> SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({"kind": st.just(kind)}, optional={**_BRIGHTNESS, **fields})


_SPOTS = _light("spot", position=_COORDINATES, direction=_DIRECTIONS, cone=_CONES)
_LIGHTS = st.one_of(
    _light("point", position=_COORDINATES),
    _SPOTS,
    _light("directional", direction=_DIRECTIONS, angle=st.floats(0.0, 30.0)),
    _light("disc", position=_COORDINATES, direction=_DIRECTIONS, radius=_LENGTHS),
    _light("sphere", position=_COORDINATES, radius=_LENGTHS),
    _light("tube", position=_COORDINATES, direction=_DIRECTIONS, radius=_LENGTHS, length=_LENGTHS),
    _light("rectangle", position=_COORDINATES, direction=_DIRECTIONS, rotation=_DEGREES, size=_SIZES),
)
_TERMS = st.sampled_from(sorted(ANALYTIC)).flatmap(terms)
_MATERIAL_LOOKS = st.fixed_dictionaries({}, optional={"terms": st.lists(_TERMS, max_size=2)})

PARTIAL_LOOKS: SearchStrategy[dict[str, Any]] = st.fixed_dictionaries(
    {},
    optional={
        "materials": st.fixed_dictionaries({}, optional={material.name: _MATERIAL_LOOKS for material in MATERIALS}),
        "lights": st.fixed_dictionaries({}, optional={"Key": _SPOTS, "Lamp": _LIGHTS, "a/b~": _LIGHTS}),
        "environment": st.fixed_dictionaries(
            {}, optional={"intensity": st.floats(0.0, 100.0), "color": COLORS, "rotation": _DEGREES}
        ),
        "background": st.fixed_dictionaries(
            {},
            optional={
                "kind": st.sampled_from(["map", "blurred", "color", "transparent"]),
                "color": COLORS,
                "blur": st.floats(2.0, 60.0),
            },
        ),
        "transport": st.fixed_dictionaries(
            {}, optional={"show": st.sampled_from(["all", "direct", "indirect"]), "bounces": st.integers(0, 24)}
        ),
        "display": st.fixed_dictionaries(
            {}, optional={"exposure": st.floats(-20.0, 20.0), "tone_map": st.sampled_from(["agx", "filmic", "none"])}
        ),
    },
)
