"""The types of a complete look: what `validate` returns and what the API's schema shows.

Terms stay dictionaries, so that `relume.brdf.curves` reads the same thing from a look and from its JSON.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple, NotRequired

from pydantic import BaseModel, ConfigDict, Field
from typing_extensions import TypedDict  # pydantic asks for this one before Python 3.12

from relume.brdf.texture_slots import NormalMap
from relume.image_io.ocio.view import OcioView

Rgb = tuple[float, float, float]
Xyz = tuple[float, float, float]
LightKind = Literal["point", "spot", "directional", "rectangle", "mesh"]
ToneMap = Literal["agx", "filmic", "none"]
PathFilter = Literal["all", "direct", "indirect", "first_bounce", "further_bounces"]
BackgroundKind = Literal["map", "blurred", "color", "transparent"]


class DrawnCurve(TypedDict):
    """A curve drawn by hand: `points`, [degrees, value], or `bands`, J values or three times J; or a change to one of
    them or to what the parameters give: `factors` and `offsets` of bands, `handles`, [degrees, was, becomes]."""

    points: NotRequired[list[tuple[float, float]]]
    bands: NotRequired[list[float] | list[list[float]]]
    factors: NotRequired[list[float] | list[list[float]]]
    offsets: NotRequired[list[float] | list[list[float]]]
    handles: NotRequired[list[tuple[float, float, float]]]
    channels: NotRequired[str]


class TermLook(TypedDict):
    """One term: colour · texture · quotient · Π curves; drawn curves stand in for those that `params` would give.

    `data` names the measured material, for models that need one and for no other. `roughness_map`: what scales the
    width of the term: "roughness", the material's own map where it has one, or "image:<id>", one that was sent; null:
    nothing. `texture` names one of the material's own images by its channel, or one that was sent.
    """

    model: str
    data: NotRequired[str]
    color: Rgb
    texture: str | None
    roughness_map: NotRequired[str | None]
    params: dict[str, float | Rgb]
    curves: dict[str, DrawnCurve | list[DrawnCurve]]


class _FrozenModel(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class NormalMapLook(_FrozenModel):
    """An image in the place of a material's normal map: "image:<id>", and how strong its bumps are, as `scale` of
    glTF."""

    image: str
    scale: float = 1.0


class MaterialLook(_FrozenModel):
    """A material is the sum of its terms.

    A `catcher` does not show them: it shows what lies behind it, as dark as its shadows and as bright as what is
    reflected onto it. `normal_map` stands in the place of the scene's own.
    """

    terms: tuple[TermLook, ...]
    shadow_catcher: bool = False
    normal_map: NormalMapLook | None = None

    @property
    def normals(self) -> NormalMap | None:
        """The same as a value; none of a catcher, whose own surface is not seen."""
        normal_map = None if self.shadow_catcher else self.normal_map
        return None if normal_map is None else NormalMap(normal_map.image, normal_map.scale)


class EnvironmentKey(NamedTuple):
    """What a picture's light depends on, brightness and tint apart: pictures of equal keys are lit alike.

    Attributes:
        map: as in `EnvironmentLook`. rotation: degrees in [0, 360).
    """

    map: str | None
    rotation: float


BAKED_ENVIRONMENT = EnvironmentKey(None, 0.0)


class EnvironmentLook(_FrozenModel):
    """The light around: multiplied by `intensity` and `color`, turned about +Y by `rotation` degrees, counter-clockwise
    seen from above. `map` names it, see `relume.assets.environments`; None: the scene's own."""

    map: str | None
    intensity: float
    color: Rgb
    rotation: float

    @property
    def key(self) -> EnvironmentKey:
        """The part that tells which environment it is, whatever its brightness."""
        return EnvironmentKey(self.map, self.rotation % 360)

    @property
    def gain(self) -> Rgb:
        """What multiplies each channel of the environment: intensity · color."""
        red, green, blue = self.color
        return self.intensity * red, self.intensity * green, self.intensity * blue


class LightGeometry(NamedTuple):
    """Where a local light is and how it is shaped, fields that its kind has not left as they are here: lights of equal
    geometry differ by a factor for each channel alone. Fields as in the look."""

    kind: LightKind
    position: Xyz = (0.0, 0.0, 0.0)
    direction: Xyz = (0.0, -1.0, 0.0)
    cone: tuple[float, float] = (0.0, 90.0)
    rotation: float = 0.0
    size: tuple[float, float] = (0.0, 0.0)
    material: str = ""


class _LightLook(_FrozenModel):
    """What lights of all kinds have; `emission` in the unit of the kind."""

    intensity: float
    color: Rgb
    enabled: bool
    emission: Rgb

    @property
    def gain(self) -> Rgb:
        """What multiplies each channel of a light of unit emission: intensity · color · emission, nothing where
        disabled."""
        scale = self.intensity if self.enabled else 0.0
        red, green, blue = (scale * c * e for c, e in zip(self.color, self.emission, strict=True))
        return red, green, blue

    @property
    def geometry(self) -> LightGeometry:
        """Everything but brightness and colour: where it is, which way it shines, and its shape."""
        return LightGeometry(**{name: value for name, value in vars(self).items() if name in LightGeometry._fields})


class PointLook(_LightLook):
    """Shines alike in all directions; emission is radiant intensity, W/sr."""

    kind: Literal["point"]
    position: Xyz


class SpotLook(_LightLook):
    """A point that shines into a cone of half-angles inner and outer, degrees; emission is W/sr along the axis."""

    kind: Literal["spot"]
    position: Xyz
    direction: Xyz
    cone: tuple[float, float]


class DirectionalLook(_LightLook):
    """Light from infinitely far that travels along `direction`; emission is irradiance across it, W/m²."""

    kind: Literal["directional"]
    direction: Xyz


class RectangleLook(_LightLook):
    """Shines to the side that `direction` points to; emission is radiance. The camera does not see it.

    `rotation` turns it about `direction`, degrees; at 0 its height lies in the plane of `direction` and +Y, or +Z where
    `direction` is vertical. `size`: width and height, metres.
    """

    kind: Literal["rectangle"]
    position: Xyz
    direction: Xyz
    rotation: float
    size: tuple[float, float]


class MeshLook(_LightLook):
    """All surfaces of a material shine, and are seen to; emission is radiance."""

    kind: Literal["mesh"]
    material: str


LightLook = Annotated[PointLook | SpotLook | DirectionalLook | RectangleLook | MeshLook, Field(discriminator="kind")]


class LightPaths(NamedTuple):
    """Which light paths a picture shows: light reaches a surface directly from a light, or by way of other surfaces.

    Attributes:
        direct: whether direct ones count.
        first, last: how many surfaces the others have on their way; none of them counts where last < first.
    """

    direct: bool
    first: int
    last: int

    @property
    def has_indirect(self) -> bool:
        """Whether any paths between surfaces count."""
        return self.last >= self.first

    def without_reflections(self) -> LightPaths:
        """Only those of these paths that reach a surface straight from a light."""
        return LightPaths(self.direct, 1, 0)

    def without_direct(self) -> LightPaths:
        """Only those of these paths that go by way of other surfaces."""
        return self._replace(direct=False)


class TransportLook(_FrozenModel):
    """Which light is shown: `bounces` reflections between surfaces at most, and of such paths all, those without any,
    those with any, those with one, or those with more."""

    show: PathFilter
    bounces: int

    @property
    def paths(self) -> LightPaths:
        """The paths as numbers, which are equal wherever the pictures are."""
        first = 2 if self.show == "further_bounces" else 1
        max_bounces = {"direct": 0, "first_bounce": 1}.get(self.show, self.bounces)
        paths = LightPaths(self.show in ("all", "direct"), first, min(max_bounces, self.bounces))
        return paths if paths.has_indirect else paths.without_reflections()

    def supported_by(self, *, has_indirect: bool) -> LightPaths:
        """Those of the paths that a method follows. reflects: whether it has light between surfaces."""
        return self.paths if has_indirect else self.paths.without_reflections()


class DisplayLook(_FrozenModel):
    """How radiance becomes a picture: `exposure` in stops, then the tone map, or a view of an OpenColorIO config."""

    exposure: float
    tone_map: ToneMap | OcioView


class BackgroundLook(_FrozenModel):
    """The background: what the camera sees where no surface is; it lights nothing.

    The map of the environment, the same `blurred` by that many degrees, one `color` (radiance), or nothing.
    """

    kind: BackgroundKind
    color: Rgb
    blur: float


class Look(_FrozenModel):
    """A complete, valid look; made by `relume.look.validate`."""

    materials: dict[str, MaterialLook]
    environment: EnvironmentLook
    background: BackgroundLook
    lights: dict[str, LightLook]
    transport: TransportLook
    display: DisplayLook

    def without_compositing(self) -> Look:
        """The same with nothing that is only put behind or under the objects: what brute force can be asked for."""
        plain = {
            name: material.model_copy(update={"shadow_catcher": False}) for name, material in self.materials.items()
        }
        background = self.background.model_copy(update={"kind": "map"})
        return self.model_copy(update={"materials": plain, "background": background})
