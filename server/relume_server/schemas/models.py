"""Bodies of BRDF models and of quantities computed from terms."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from relume.look.document import MAX_TERMS
from relume.look.model import BasisFunctions, Rgb
from relume_server.schemas.base import Body, Id, Name


class ParameterBody(Body):
    """A numeric parameter that generates curves; `scale` is the scale of its slider.

    If `requires_new_operator`, it has one value for all channels, and a change precomputes the operator anew. Values
    are multiples of `step`, if given.
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
    """An editable curve of a term; a `view_dependent` one multiplies the shaded pixel."""

    name: str
    label: str
    angle: str
    parameters: list[str]
    bands: int
    view_dependent: bool


class ModelBody(Body):
    """A BRDF model; `texture` is its default texture channel, `needs_data` whether it is measured, `width_parameter`
    the parameter that roughness maps scale, `width_power` the power of roughness that it grows with, `specular_below`
    the value below which it is a mirror, and `data_prefix` the prefix of its data names (see `data`).
    """

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
    """Terms, as in a look."""

    terms: Annotated[list[dict[str, Any]], Field(min_length=1, max_length=MAX_TERMS)]


class ZernikeFitRequest(TermsRequest):
    """All terms of a material, and the `basis_functions` of its look."""

    basis_functions: BasisFunctions | None = None


class BallRequest(TermsRequest):
    """Terms of a scene's `material`, which may use its textures."""

    material: Name


class ZernikeFitBody(Body):
    """Picture of a term while a free camera moves: `functions` of `available` basis functions, with a `residual`
    (cosine-weighted relative RMS); `required_functions`: number with a residual of at most 5 %, null if more than
    available; `drawn_by`: functions alone; lights: the environment's highlight is summed over visible lights, other
    light uses functions; rays: reflections are ray traced by the server, and blurred environment in a browser.
    """

    functions: int
    available: int
    residual: float
    required_functions: int | None
    drawn_by: Literal["functions", "lights", "rays"]


class AlbedoBody(Body):
    """Albedo of a material with white textures: `mean` over all view directions, and the `max` in any channel, at
    `max_angle_degrees` from the normal.
    """

    mean: list[float]
    max: float
    max_angle_degrees: float


class TextureMeansBody(Body):
    """Mean of the texture of each channel, linear RGB; ones without a texture."""

    diffuse: Rgb
    specular: Rgb


class PrincipledRequest(TermsRequest):
    """Terms and glass of a material's look. `scene` and `material` name the material of a scene whose textures the
    terms use; without them, its textures count as white.
    """

    glass: dict[str, Any] | None = None
    scene: Id | None = None
    material: Name | None = None


class PrincipledTermsRequest(TermsRequest):
    """Principled `parameters`, omitted ones with their defaults, and the material's own `terms` and `glass`, whose
    textures and absorption stay. `texture_means`: as returned with the parameters.
    """

    parameters: dict[str, Any]
    glass: dict[str, Any] | None = None
    texture_means: TextureMeansBody | None = None


class PrincipledParameters(Body):
    """Principled parameters, as in docs/api.md: colors are linear Rec. 709, roughness is perceptual."""

    base_color: Rgb
    metallic: float
    roughness: float
    specular: float
    specular_color: Rgb
    ior: float
    anisotropy: float
    coat_weight: float
    coat_roughness: float
    sheen_weight: float
    sheen_color: Rgb
    sheen_roughness: float
    transmission: float


class PrincipledTermsBody(Body):
    """Terms of principled parameters; `glass` is null for an opaque material."""

    terms: list[dict[str, Any]]
    glass: dict[str, Any] | None


class PrincipledBody(PrincipledTermsBody):
    """Principled `parameters` of a material. If they have its terms, `reason` is null; otherwise `parameters`, `terms`
    and `glass` are those of the closest principled material, `error` is its relative RMS error of cosine-weighted BRDF
    values, and `reason` a sentence.
    """

    parameters: PrincipledParameters
    error: float
    reason: str | None
    texture_means: TextureMeansBody
