"""Types of a complete look, returned by `validate` and shown in the API schema.

Terms stay dictionaries, so that `relume.brdf.curves` handles looks and their JSON alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from typing import Annotated, Any, Literal, NamedTuple, NotRequired, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PrivateAttr, model_validator
from pydantic.dataclasses import dataclass
from typing_extensions import TypedDict  # pydantic requires it before Python 3.12

from relume.brdf.texture_slots import NormalMap
from relume.image_io.display_transform import DisplayTransform
from relume.image_io.ocio.view import OcioView
from relume.look.object_links import link_object_materials
from relume.luts.lut_store import load_table
from relume.math.uv_transform import UvTransform

Rgb = tuple[float, float, float]
Xyz = tuple[float, float, float]
LightKind = Literal[
    "point",
    "spot",
    "directional",
    "rectangle",
    "disc",
    "sphere",
    "tube",
    "mesh",
    "points",
    "panels",
    "directionals",
    "surfaces",
]
ToneMap = Literal["agx", "filmic", "none"]
PathFilter = Literal["all", "direct", "indirect", "first_bounce", "further_bounces"]
BackgroundKind = Literal["map", "blurred", "color", "transparent"]
BasisFunctions = Literal[1, 3, 6, 10, 15, 21, 28, 36]
"""Numbers of Zernike functions up to a degree; other prefixes would not be symmetric about the normal."""


class DrawnCurve(TypedDict):
    """A curve drawn by hand: `points`, [degrees, value], or `bands`, J values for all channels or 3 × J; or a change of
    that curve or of the generated one: `factors` and `offsets` per band, `handles`, [degrees, was, becomes]."""

    points: NotRequired[list[tuple[float, float]]]
    bands: NotRequired[list[float] | list[list[float]]]
    factors: NotRequired[list[float] | list[list[float]]]
    offsets: NotRequired[list[float] | list[list[float]]]
    handles: NotRequired[list[tuple[float, float, float]]]
    channels: NotRequired[str]


class TermLook(TypedDict):
    """One term: color · texture · quotient · Π curves. Drawn curves replace those generated from `params`.

    `data`: name of the measured material, only for models that need one. `roughness_map`: scales the width of the
    highlight: "roughness" for the material's own map, "image:<id>" for an uploaded one, null for none. `texture`: a
    texture channel of the material, or an uploaded image.
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
    """An uploaded image that replaces a material's normal map: "image:<id>", and its strength as glTF's `scale`."""

    image: str
    scale: float = 1.0


class UvLook(_FrozenModel):
    """Transform of a material's texture coordinates: `scale`, then `rotation` in degrees, then `offset`, as in glTF's
    KHR_texture_transform. See `relume.math.uv_transform`."""

    scale: tuple[float, float] = (1.0, 1.0)
    rotation: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)


class GlassLook(_FrozenModel):
    """Light through a surface of glass; its material's terms are what it reflects.

    `color`: transmittance of one passage, without reflection. `absorption`: coefficients inside a solid, per meter; not
    of thin glass. `roughness`: as the transmitted light shows it, the square root of the width of GGX facets. `ior`:
    index of refraction.
    """

    color: Rgb
    absorption: Rgb = (0.0, 0.0, 0.0)
    roughness: float
    ior: float


Names = Annotated[tuple[str, ...], AfterValidator(lambda names: tuple(sorted(set(names))))]
"""A set of names: equal sets are equal keys of a cache."""


class MaterialLook(_FrozenModel):
    """A material: the sum of its terms.

    A `shadow_catcher` hides its terms: it shows the background times the ratio of light with and without the objects.
    `normal_map` replaces the scene's own. `uv` transforms the texture coordinates of all its images.
    `glass`: only materials that transmit light in the scene have it.
    `basis_functions`: while a free camera moves, all terms are the sum of this many functions of the in-out
    factorization, without separate highlights, to compare; null: as many as each term needs, highlights separate.
    `base` and `objects`: of a material that the look adds; it is that of these objects instead of the scene's material
    `base`. Null for materials of the scene.
    """

    terms: tuple[TermLook, ...]
    shadow_catcher: bool = False
    normal_map: NormalMapLook | None = None
    uv: UvLook | None = None
    glass: GlassLook | None = None
    basis_functions: BasisFunctions | None = None
    base: str | None = None
    objects: Names = ()

    @property
    def normals(self) -> NormalMap | None:
        """The normal map override; none for a shadow catcher, which hides its own surface."""
        normal_map = None if self.shadow_catcher else self.normal_map
        return None if normal_map is None else NormalMap(normal_map.image, normal_map.scale, self.uv_transform)

    @property
    def uv_transform(self) -> UvTransform | None:
        """The transform of texture coordinates; None for the identity."""
        if self.uv is None:
            return None
        transform = UvTransform(self.uv.offset, radians(self.uv.rotation), self.uv.scale)
        return None if transform == UvTransform() else transform


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class SurfaceNames:
    """Surfaces by name: all of some materials, and all of some objects. Objects are the meshes of the scene."""

    materials: Names = ()
    objects: Names = ()


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class IncludeLink:
    """Only these surfaces."""

    include: SurfaceNames


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class ExcludeLink:
    """All surfaces but these."""

    exclude: SurfaceNames


Link = IncludeLink | ExcludeLink
"""Surfaces that a light lights, or that cast its shadows. Dataclasses, since links are parts of keys."""


class EnvironmentKey(NamedTuple):
    """Everything that images depend on linearly through the environment, except brightness and tint.

    Attributes:
        map: as in `EnvironmentLook`. rotation: degrees in [0, 360). link: as in `EnvironmentLook`.
    """

    map: str | None
    rotation: float
    link: Link | None = None

    @property
    def unlinked(self) -> EnvironmentKey:
        """The environment that lights all surfaces."""
        return self._replace(link=None)


BAKED_ENVIRONMENT = EnvironmentKey(None, 0.0)


class EnvironmentLook(_FrozenModel):
    """The environment: multiplied by `intensity` and `color`, rotated about +Y by `rotation` degrees, counterclockwise
    from above. `map` names it, see `relume.assets.environments`; None: the scene's own. `link`: the surfaces that it
    lights; None: all."""

    map: str | None
    intensity: float
    color: Rgb
    rotation: float
    link: Link | None = None

    @property
    def key(self) -> EnvironmentKey:
        """Map, rotation and link, without brightness."""
        return EnvironmentKey(self.map, self.rotation % 360, self.link)

    @property
    def gain(self) -> Rgb:
        """Factor of each channel of the environment: intensity · color."""
        red, green, blue = self.color
        return self.intensity * red, self.intensity * green, self.intensity * blue


MaterialEmissions = tuple[tuple[str, Rgb], ...]


class LightGeometry(NamedTuple):
    """Position and shape of a local light; fields that its kind lacks have their defaults. Lights with equal geometry
    differ only by a factor for each channel. Fields as in the look; `source`: name of a source of several lights in the
    scene; `channel`: the one of RGB that it emits, as a part of a light that emits a colored image, or of surfaces of
    several colors."""

    kind: LightKind
    position: Xyz = (0.0, 0.0, 0.0)
    direction: Xyz = (0.0, -1.0, 0.0)
    cone: tuple[float, float] = (0.0, 90.0)
    rotation: float = 0.0
    size: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.0
    length: float = 0.0
    angle: float = 0.0
    material: str = ""
    image: str | None = None
    source: str = ""
    materials: MaterialEmissions = ()
    channel: int | None = None
    link: Link | None = None
    shadow_link: Link | None = None
    profile: str | None = None
    gobo: str | None = None

    @property
    def is_source(self) -> bool:
        """True for a source of many lights of the scene."""
        return bool(self.source or self.materials)

    @property
    def material_emissions(self) -> MaterialEmissions:
        """The materials whose surfaces emit this light, with their emission relative to the light's."""
        return ((self.material, (1.0, 1.0, 1.0)),) if self.kind == "mesh" else self.materials


class LightGroupLook(_FrozenModel):
    """A group of lights: `intensity` and `color` multiply their gains; a disabled group turns them off."""

    lights: tuple[str, ...]
    intensity: float
    color: Rgb
    enabled: bool


class _LightLook(_FrozenModel):
    """Common fields of all lights; the unit of `emission` depends on the kind.

    `link`: the surfaces that the light lights; `shadow_link`: those that cast its shadows. None: all.
    """

    intensity: float
    color: Rgb
    enabled: bool
    emission: Rgb
    link: Link | None = None
    shadow_link: Link | None = None
    _group: LightGroupLook | None = PrivateAttr(None)

    @property
    def gain(self) -> Rgb:
        """Factor of each channel of a light with unit emission, `full_gain`; zero if it or its group is disabled."""
        is_enabled = self.enabled and (self._group is None or self._group.enabled)
        return self.full_gain if is_enabled else (0.0, 0.0, 0.0)

    @property
    def full_gain(self) -> Rgb:
        """Factor of each channel of an enabled light: intensity · color · emission, and those of its group."""
        if self._group is None:
            return self.gain_in_group
        red, green, blue = (
            self._group.intensity * c * g for c, g in zip(self._group.color, self.gain_in_group, strict=True)
        )
        return red, green, blue

    @property
    def gain_in_group(self) -> Rgb:
        """Factor of each channel of an enabled light without those of its group: intensity · color · emission."""
        red, green, blue = (self.intensity * c * e for c, e in zip(self.color, self.emission, strict=True))
        return red, green, blue

    @property
    def geometry(self) -> LightGeometry:
        """Everything except brightness and color."""
        return LightGeometry(**{name: value for name, value in vars(self).items() if name in LightGeometry._fields})


class PointLook(_LightLook):
    """A point light that emits equally in all directions; emission is radiant intensity, W/sr.

    `profile`: an uploaded IES file, "ies:<id>", by which it emits: intensity is emission times the file's over its
    maximum. `direction`: its nadir. `rotation`: of its C0 about that, degrees; at 0, C0 of a light that points down is
    +X, C90 −Z. None: equally in all directions.
    """

    kind: Literal["point"]
    position: Xyz
    direction: Xyz = (0.0, -1.0, 0.0)
    rotation: float = 0.0
    profile: str | None = None


class SpotLook(_LightLook):
    """A point light with inner and outer cone half-angles in degrees; emission is intensity on the axis, W/sr.

    `gobo`: an uploaded image, "image:<id>", in the square about the cone; its linear RGB multiplies the intensity.
    `profile`: as of a point light. `rotation`: of both about the direction, degrees.
    """

    kind: Literal["spot"]
    position: Xyz
    direction: Xyz
    cone: tuple[float, float]
    rotation: float = 0.0
    profile: str | None = None
    gobo: str | None = None


class DirectionalLook(_LightLook):
    """Light from infinity that travels along `direction`; emission is irradiance perpendicular to it, W/m².

    `angle`: diameter of the disk that it comes from, degrees; 0 for parallel light.
    """

    kind: Literal["directional"]
    direction: Xyz
    angle: float


class RectangleLook(_LightLook):
    """A rectangular area light that emits toward `direction`; emission is radiance. The camera does not see it.

    `rotation` rotates it about `direction`, degrees; at 0 its height lies in the plane of `direction` and +Y, or of +Z
    if `direction` is vertical. `size`: width and height, meters.
    """

    kind: Literal["rectangle"]
    position: Xyz
    direction: Xyz
    rotation: float
    size: tuple[float, float]


class DiscLook(_LightLook):
    """A disc that emits toward `direction`; emission is radiance. The camera does not see it. `radius`: meters."""

    kind: Literal["disc"]
    position: Xyz
    direction: Xyz
    radius: float


class SphereLook(_LightLook):
    """A sphere; emission is radiance. The camera does not see it. `radius`: meters."""

    kind: Literal["sphere"]
    position: Xyz
    radius: float


class TubeLook(_LightLook):
    """A tube, whose side emits and whose ends do not; emission is radiance. The camera does not see it.

    `position`: its middle. `direction`: its axis. `radius`, `length`: meters.
    """

    kind: Literal["tube"]
    position: Xyz
    direction: Xyz
    radius: float
    length: float


class MeshLook(_LightLook):
    """All surfaces of a material emit and are visible; emission is radiance.

    `image`: an uploaded image, "image:<id>", by which they emit: radiance is emission times its linear RGB. None: they
    emit as in the scene.
    """

    kind: Literal["mesh"]
    material: str
    image: str | None = None


class PointsLook(_LightLook):
    """Many point and spot lights of the scene as one source, its `source`; emission is their mean intensity, W/sr."""

    kind: Literal["points"]
    source: str


class PanelsLook(_LightLook):
    """Many area lights of the scene as one source, its `source`; emission is their mean radiance by area."""

    kind: Literal["panels"]
    source: str


class DirectionalsLook(_LightLook):
    """Many directional lights of the scene as one source, its `source`; emission is their mean irradiance."""

    kind: Literal["directionals"]
    source: str


class SurfacesLook(_LightLook):
    """All surfaces of several materials of the scene as one source; emission is their mean radiance by area.

    `materials`: each with its radiance over the mean, for each channel.
    """

    kind: Literal["surfaces"]
    materials: MaterialEmissions


AreaLook = RectangleLook | DiscLook | SphereLook | TubeLook
"""Area lights other than emissive meshes."""
SingleLightLook = PointLook | SpotLook | DirectionalLook | AreaLook | MeshLook
MembersLook = PointsLook | PanelsLook | DirectionalsLook
"""Sources of many lights whose places are of the scene."""
LightLook = Annotated[SingleLightLook | MembersLook | SurfacesLook, Field(discriminator="kind")]


_MANY_BOUNCES = 8  # later ones bring hardly any light


class LightPaths(NamedTuple):
    """Light paths of an image: direct illumination and a range of bounces.

    Attributes:
        direct: includes direct illumination.
        first, last: range of bounces of the indirect illumination; none if last < first.
    """

    direct: bool
    first: int
    last: int

    @property
    def has_indirect(self) -> bool:
        """True if any indirect light is included."""
        return self.last >= self.first

    @property
    def has_all_bounces(self) -> bool:
        """True if indirect light includes the first bounce and all that matter."""
        return self.first == 1 and self.last >= _MANY_BOUNCES

    def without_reflections(self) -> LightPaths:
        """These paths without indirect illumination."""
        return LightPaths(self.direct, 1, 0)

    def without_direct(self) -> LightPaths:
        """These paths without direct illumination."""
        return self._replace(direct=False)


class TransportLook(_FrozenModel):
    """Light paths to show: all, direct, indirect, first bounce or further bounces, with at most `bounces` bounces."""

    show: PathFilter
    bounces: int

    @property
    def paths(self) -> LightPaths:
        """The paths as numbers; equal if and only if the images are equal."""
        first = 2 if self.show == "further_bounces" else 1
        max_bounces = {"direct": 0, "first_bounce": 1}.get(self.show, self.bounces)
        paths = LightPaths(self.show in ("all", "direct"), first, min(max_bounces, self.bounces))
        return paths if paths.has_indirect else paths.without_reflections()

    def supported_by(self, *, has_indirect: bool) -> LightPaths:
        """The paths that a method supports. has_indirect: the method has indirect illumination."""
        return self.paths if has_indirect else self.paths.without_reflections()


class DisplayLook(_FrozenModel):
    """Conversion from radiance to display: white balance, `exposure` in stops, then `contrast`, then the tone map
    or an OpenColorIO view, then a LUT of display values.

    `temperature`: of the light that shows as white, kelvin; 6500 leaves colors unchanged. `tint`: a positive one takes
    green out. `contrast`: slope of log radiance about middle gray; 1 leaves it unchanged. `lut`: "lut:<id>" of an
    uploaded LUT; null: none.
    """

    exposure: float
    tone_map: ToneMap | OcioView
    temperature: float
    tint: float
    contrast: float
    lut: str | None

    @property
    def transform(self) -> DisplayTransform:
        """The conversion of images. Raises NotFoundError if the LUT was deleted."""
        table = None if self.lut is None else load_table(self.lut)
        return DisplayTransform(self.exposure, self.tone_map, self.temperature, self.tint, table, self.contrast)


class BackgroundLook(_FrozenModel):
    """The background, visible behind all surfaces; it lights nothing.

    The environment map, the same `blurred` by an angle in degrees, one `color` (radiance), or transparent.
    """

    kind: BackgroundKind
    color: Rgb
    blur: float


class Look(_FrozenModel):
    """A complete, valid look, made by `relume.look.validate`."""

    materials: dict[str, MaterialLook]
    environment: EnvironmentLook
    background: BackgroundLook
    lights: dict[str, LightLook]
    light_groups: dict[str, LightGroupLook]
    transport: TransportLook
    display: DisplayLook

    @model_validator(mode="before")
    @classmethod
    def _link_object_materials(cls, document: Any) -> Any:
        return link_object_materials(document) if isinstance(document, Mapping) else document

    @model_validator(mode="after")
    def _group_lights(self) -> Self:
        for group in self.light_groups.values():
            for name in group.lights:
                self.lights[name]._group = group
        return self

    def without_compositing(self) -> Look:
        """The look without shadow catchers and with the environment as background, as the reference renders it."""
        plain = {
            name: material.model_copy(update={"shadow_catcher": False}) for name, material in self.materials.items()
        }
        background = self.background.model_copy(update={"kind": "map"})
        return self.model_copy(update={"materials": plain, "background": background})
