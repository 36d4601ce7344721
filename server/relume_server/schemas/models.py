"""Bodies that describe BRDF terms: what each model takes, and what stands behind a look's terms."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from relume.look.document import MAX_TERMS
from relume_server.schemas.base import Body, Name


class ParameterBody(Body):
    """A number that generates curves; `scale` says how a slider moves.

    One that `requires_new_operator` has one value for all channels; a change of it precomputes the operator anew.
    Values are multiples of `step`, where it is given.
    """

    name: str
    label: str
    minimum: float
    maximum: float
    default: float
    unit: str
    scale: Literal["linear", "log"]
    help: str
    step: float | None
    requires_new_operator: bool


class CurveBody(Body):
    """An editable factor of a term; a `view_dependent` one multiplies the finished pixel."""

    name: str
    label: str
    angle: str
    parameters: list[str]
    bands: int
    view_dependent: bool


class ModelBody(Body):
    """A BRDF term; `texture` is the channel it takes by default, `needs_data` whether it is measured, `width_parameter`
    the one that maps of roughness scale, `width_power` the power of a roughness that it grows with, `specular_below`
    where it makes a mirror, and `data_prefix` how the names of such data begin (see `data`)."""

    model: str
    label: str
    help: str
    source: str
    texture: str
    needs_data: bool
    width_parameter: str | None
    width_power: float | None
    specular_below: float | None
    data_prefix: str | None
    parameters: list[ParameterBody]
    curves: list[CurveBody]


class TermsRequest(Body):
    """Terms as they stand in a look."""

    terms: Annotated[list[dict[str, Any]], Field(min_length=1, max_length=MAX_TERMS)]


class BallRequest(TermsRequest):
    """Terms of a `material` of a scene, whose own images they may name."""

    material: Name


class ZernikeFitBody(Body):
    """How a term is sent in views whose eye moves: by so many `functions` of the incident light, with a `residual`
    (cosine-weighted relative RMS); `required_functions`: how many would miss a twentieth, null where more than these;
    `is_mirror`: as a blurred mirror instead."""

    functions: int
    residual: float
    required_functions: int | None
    is_mirror: bool


class AlbedoBody(Body):
    """What share of even light a material sends back, its textures white: the `mean` over all directions, and the
    `max` in any channel, at `max_angle_degrees` from the normal."""

    mean: list[float]
    max: float
    max_angle_degrees: float
