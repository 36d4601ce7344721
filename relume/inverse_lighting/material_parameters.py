"""Numbers of materials that a match may change: colors and parameters of terms, as positions between their limits."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.registry import TERMS
from relume.brdf.term import Parameter
from relume.core.errors import ParameterError
from relume.core.validation import names_text
from relume.look import Look

F64 = NDArray[np.float64]
MAX_PARAMETERS = 64
_COLOR = "color"


@dataclass(frozen=True)
class MaterialParameter:
    """A number of a term: a component of its color, or a parameter that generates curves.

    Attributes:
        material, term: name of the material and index of the term. name: "color", or that of the parameter.
        channel: of RGB; None if all have one value. minimum, maximum: limits. is_log: positions are logarithmic.
    """

    material: str
    term: int
    name: str
    channel: int | None
    minimum: float
    maximum: float
    is_log: bool

    def position(self, look: Look) -> float:
        """Return its position in [0, 1] in a look."""
        values = self._values(look.materials[self.material].terms[self.term])
        value = values if self.channel is None else values[self.channel]
        return float((self._scaled(value) - self._start) / (self._scaled(self.maximum) - self._start))

    def set_position(self, term: dict[str, Any], position: float) -> None:
        """Write its value at a position into a term."""
        scaled = self._start + position * (self._scaled(self.maximum) - self._start)
        value: Any = min(max(math.exp(scaled) if self.is_log else scaled, self.minimum), self.maximum)
        if self.channel is not None:
            value = tuple(value if c == self.channel else old for c, old in enumerate(self._values(term)))
        if self.name == _COLOR:
            term[_COLOR] = value
        else:
            term["params"] = {**term["params"], self.name: value}

    @property
    def _start(self) -> float:
        return self._scaled(self.minimum)

    def _scaled(self, value: float) -> float:
        return math.log(max(value, self.minimum)) if self.is_log else value

    def _values(self, term: Any) -> Any:
        return term[_COLOR] if self.name == _COLOR else term["params"][self.name]


def material_parameters(look: Look, names: Collection[str]) -> tuple[MaterialParameter, ...]:
    """Return the numbers of materials that a match may change.

    Colors stay in [0, 1], or below their current value. Parameters that need a new operator, or have steps, stay.

    Args:
        look: the look. names: of the materials.
    Raises:
        ParameterError: a name is no material; a material has no such number; there are more than `MAX_PARAMETERS`.
    """
    if unknown := set(names) - set(look.materials):
        raise ParameterError("materials", min(unknown), f"names of materials: {names_text(look.materials)}")
    by_material = {name: list(_material_parameters(look, name)) for name in sorted(names)}
    for name, parameters in by_material.items():
        if not parameters:
            raise ParameterError("materials", name, "materials with terms; leave this one out")
    every = tuple(parameter for parameters in by_material.values() for parameter in parameters)
    if len(every) > MAX_PARAMETERS:
        raise ParameterError(
            "materials", f"materials with {len(every)} numbers", f"at most {MAX_PARAMETERS} numbers; name fewer"
        )
    return every


def _material_parameters(look: Look, name: str) -> Iterator[MaterialParameter]:
    for k, term in enumerate(look.materials[name].terms):
        for channel, value in enumerate(term["color"]):
            yield MaterialParameter(name, k, _COLOR, channel, 0.0, max(1.0, value), False)
        declaration = TERMS[term["model"]]
        for parameter in declaration.parameters:
            if parameter.name not in declaration.fixed and parameter.step is None:
                yield from _term_parameters(name, k, parameter, term["params"][parameter.name])


def _term_parameters(
    material: str, term: int, parameter: Parameter, value: float | tuple[float, ...]
) -> Iterator[MaterialParameter]:
    channels = range(len(value)) if isinstance(value, tuple) else (None,)
    for channel in channels:
        yield MaterialParameter(
            material, term, parameter.name, channel, parameter.minimum, parameter.maximum, parameter.scale == "log"
        )


def positions_of(look: Look, parameters: Sequence[MaterialParameter]) -> Shaped[F64, " parameters"]:
    """Return the positions of parameters in a look."""
    return np.array([parameter.position(look) for parameter in parameters])


def with_positions(look: Look, parameters: Sequence[MaterialParameter], positions: Shaped[F64, " parameters"]) -> Look:
    """Return the look with parameters at positions in [0, 1]."""
    terms: dict[str, list[Any]] = {
        name: [dict(term) for term in look.materials[name].terms] for name in {each.material for each in parameters}
    }
    for parameter, position in zip(parameters, positions, strict=True):
        parameter.set_position(terms[parameter.material][parameter.term], float(position))
    changed = {name: look.materials[name].model_copy(update={"terms": tuple(terms[name])}) for name in terms}
    return look.model_copy(update={"materials": {**look.materials, **changed}})
