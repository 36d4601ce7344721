"""Bodies of REST and messages of sessions, as `docs/api.md` describes them.

Written by `python -m relume_server.python_types` from the server's models. Do not edit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal, NotRequired, TypedDict


SUBPROTOCOL: Final = "relume.v2"
MAX_MESSAGE_BYTES: Final = 65536


class ArrayInfo(TypedDict):
    """An array of a payload or of GET /api/bakes/{id}/probes: number of texels, each of 1, 2 or 4 numbers."""

    name: str
    dtype: Literal["float32", "float16", "uint32", "int32"]
    shape: Sequence[int]


class BackgroundLook(TypedDict):
    """The background, visible behind all surfaces; it lights nothing."""

    kind: NotRequired[Literal["map", "blurred", "color", "transparent"]]
    color: NotRequired[Sequence[float]]
    blur: NotRequired[float]


class BakeBody(TypedDict):
    """A bake; `progress` 0…1, `problem` is a sentence if it failed or had to restart."""

    id: str
    user: str
    created: str
    scene: str
    state: Literal["queued", "running", "ready", "failed", "canceled"]
    progress: float
    phase: Literal["starting", "loading", "reading", "building", "compiling", "sampling", "tracing", "publishing"] | None
    phase_seconds: float | None
    queue_position: int
    rays_per_second: float | None
    seconds_left: float | None
    bytes: int
    problem: str | None
    code: str | None
    is_current: bool
    recipe: RecipeBody
    plan: PlanBody | None


class BakeMessage(TypedDict):
    """server → client: another bake of the scene is running or ready; to use it, open a session and send the look."""

    type: Literal["bake"]
    bake: str
    replaces: str
    state: str
    progress: float
    phase: Literal["starting", "loading", "reading", "building", "compiling", "sampling", "tracing", "publishing"] | None
    seconds_left: float | None


class BakeOptions(TypedDict):
    """Optional fields of a request."""

    views: NotRequired[Sequence[str | CameraBody] | None]
    preset: NotRequired[Literal["preview", "good", "final"] | None]
    aspect: NotRequired[float | None]
    size: NotRequired[Sequence[int] | None]
    lights: NotRequired[int | None]
    probes: NotRequired[int | None]
    patches: NotRequired[int | None]
    gather_rays: NotRequired[int | None]
    relightable: NotRequired[bool]


class BakeView(TypedDict):
    """A view of a bake; `bake` null: that of the request."""

    view: str
    bake: NotRequired[str | None]


class CameraBody(TypedDict):
    """A camera that a user placed, by name."""

    to_world: Sequence[float]
    yfov: float
    near: NotRequired[float]
    lens: NotRequired[LensBody | None]
    name: str


class CameraFrame(TypedDict):
    """Pose and field of view of a camera."""

    to_world: Sequence[float]
    yfov: float
    near: NotRequired[float]


class CameraInfo(TypedDict):
    """A camera that looks along its -Z. `to_world`: 4 × 4, row by row, rigid, meters. `yfov`: vertical, radians.
    `near`: distance of the near clipping plane, meters."""

    to_world: Sequence[float]
    yfov: float
    near: float


class CameraPath(TypedDict):
    """Interpolate cameras, spaced evenly over the frames, or as the looks if there are equally many; one frame each if
    no number of frames is given."""

    cameras: Sequence[CameraFrame]


class CommentsMessage(TypedDict):
    """server → client: a comment of the scene was added, resolved or deleted; read the list again."""

    type: Literal["comments"]


class CurveBody(TypedDict):
    """An editable curve of a term; a `view_dependent` one multiplies the shaded pixel."""

    name: str
    label: str
    angle: str
    parameters: Sequence[str]
    bands: int
    view_dependent: bool


class CurveMessage(TypedDict):
    """server → client: the active curve at this revision, band averages per channel, over 0…`max_degrees`."""

    type: Literal["curve"]
    curve: str
    revision: int
    bands: Sequence[Sequence[float]]
    generated: Sequence[Sequence[float]]
    max_degrees: float


class DirectionalLook(TypedDict):
    """Light from infinity that travels along `direction`; emission is irradiance perpendicular to it, W/m²."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["directional"]]
    direction: NotRequired[Sequence[float]]
    angle: NotRequired[float]


class DirectionalsLook(TypedDict):
    """Many directional lights of the scene as one source, its `source`; emission is their mean irradiance."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["directionals"]]
    source: NotRequired[str]


class DiscLook(TypedDict):
    """A disc that emits toward `direction`; emission is radiance. The camera does not see it. `radius`: meters."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["disc"]]
    position: NotRequired[Sequence[float]]
    direction: NotRequired[Sequence[float]]
    radius: NotRequired[float]


class DisplayLook(TypedDict):
    """Conversion from radiance to display: white balance, `exposure` in stops, then `contrast`, then the tone map or an
    OpenColorIO view, then a LUT of display values."""

    exposure: NotRequired[float]
    tone_map: NotRequired[Literal["agx", "filmic", "none"] | OcioView]
    temperature: NotRequired[float]
    tint: NotRequired[float]
    contrast: NotRequired[float]
    lut: NotRequired[str | None]


class DrainMessage(TypedDict):
    """server → client: the server is stopping. Open the session again, here or on another server, within so many
    seconds; until then this one continues. Send the look if the new server does not know the resume token."""

    type: Literal["server_draining"]
    seconds: float


class DrawnCurve(TypedDict):
    """A curve drawn by hand: `points`, [degrees, value], or `bands`, J values for all channels or 3 × J; or a change of
    that curve or of the generated one: `factors` and `offsets` per band, `handles`, [degrees, was, becomes]."""

    points: NotRequired[Sequence[Sequence[float]]]
    bands: NotRequired[Sequence[float] | Sequence[Sequence[float]]]
    factors: NotRequired[Sequence[float] | Sequence[Sequence[float]]]
    offsets: NotRequired[Sequence[float] | Sequence[Sequence[float]]]
    handles: NotRequired[Sequence[Sequence[float]]]
    channels: NotRequired[str]


class EnvironmentLook(TypedDict):
    """The environment: multiplied by `intensity` and `color`, rotated about +Y by `rotation` degrees, counterclockwise
    from above. `map` names it, see `relume.assets.environments`; None: the scene's own. `link`: the surfaces that it
    lights; None: all."""

    map: NotRequired[str | None]
    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    rotation: NotRequired[float]
    link: NotRequired[IncludeLink | ExcludeLink | None]


class ExcludeLink(TypedDict):
    """All surfaces but these."""

    exclude: NotRequired[SurfaceNames]


Fidelity = Literal["preview", "approximate", "incremental", "near_exact", "exact"]


class FrameHeader(TypedDict):
    """Header of a binary frame. `room_revision`: of the last `RoomUpdate` that it shows. `camera_seq`: of the camera
    that it shows, null before the first one and for fixed cameras. `exact`: the client's whole image is exact;
    `fidelity`: of its visible region. `complete`: every term is shown. `free_camera_error`: with the first exact frame
    after the camera stopped: error of the image shown while it moved, without corrections. `traces_lobes`: a free
    camera traces rays along narrow lobes, which a browser cannot draw. `scene_update`: only for kind "scene_update"."""

    frame: int
    revision: int
    room_revision: int
    view: str
    width: int
    height: int
    tiles: Sequence[Sequence[int]]
    format: Literal["rgb9e5", "jpeg", "png", "f32", "r8", "arrays"]
    exact: bool
    fidelity: Fidelity
    complete: bool
    kind: Literal["picture", "highlight", "scene_update"]
    alpha: bool
    camera_seq: int | None
    free_camera_error: FreeCameraError | None
    traces_lobes: bool
    scene_update: SceneUpdate | None
    ms: FrameTimes


class FrameTimes(TypedDict):
    """Milliseconds spent on a frame: waiting, updating the image, encoding."""

    wait: float
    update: float
    encode: float


class FreeCameraError(TypedDict):
    """Error of free-camera images while the camera moves, over surfaces. `delta_e`: mean CIEDE2000 difference of the
    displayed images, about 1 is just noticeable; `rms`: relative RMS error of linear radiance. Standard errors: of
    estimates; null for one whole image."""

    delta_e: float
    rms: float
    delta_e_standard_error: float | None
    rms_standard_error: float | None


class GlassLook(TypedDict):
    """Light through a surface of glass; its material's terms are what it reflects."""

    color: NotRequired[Sequence[float]]
    absorption: NotRequired[Sequence[float]]
    roughness: NotRequired[float]
    ior: NotRequired[float]


class HelloMessage(TypedDict):
    """server → client: first message. `revision` and `solo` are the last ones of a resumed session, otherwise 0 and
    null."""

    type: Literal["hello"]
    session: str
    bake: str
    method: str
    axes: Sequence[Literal["curve", "parameter", "light", "environment", "bounces", "camera"]]
    scene: str
    look: Mapping[str, Any]
    solo: Sequence[str] | None
    revision: int
    resumed: bool
    focused_view: str
    visible_views: Sequence[str]
    views: Sequence[ViewInfo]
    materials: Sequence[str]
    resume: str
    role: Literal["view", "edit", "admin"]
    room: RoomInfo | None
    free_camera_error: FreeCameraError | None


class ImportOptions(TypedDict):
    """Optional fields of a request."""

    name: NotRequired[str]
    ground: NotRequired[bool]
    up: NotRequired[Literal["file", "y", "z", "-z"]]
    unit: NotRequired[Literal["file", "m", "cm", "mm", "in", "ft", "auto"]]
    recenter: NotRequired[Literal["auto", "always", "never"]]
    light_unit: NotRequired[Literal["file", "W/sr", "W"]]
    scene_name: NotRequired[str]
    time: NotRequired[float | None]


class IncludeLink(TypedDict):
    """Only these surfaces."""

    include: NotRequired[SurfaceNames]


class InspectAnswer(TypedDict):
    """server → client: one pixel; `bands` is the contribution of each band of the active curve, per channel."""

    type: Literal["inspect"]
    view: str
    x: int
    y: int
    material: str | None
    position: Sequence[float] | None
    normal: Sequence[float] | None
    radiance: Sequence[float]
    curve: str | None
    bands: Sequence[Sequence[float]] | None


class LensBody(TypedDict):
    """Depth of field: `radius` of the aperture and depth that is sharp, meters; `blades` of a polygon, 0: round."""

    radius: float
    focus_distance: float
    blades: NotRequired[int]


class LightGroupLook(TypedDict):
    """A group of lights: `intensity` and `color` multiply their gains; a disabled group turns them off."""

    lights: NotRequired[Sequence[str]]
    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]


class LookDocument(TypedDict):
    """A complete, valid look, made by `relume.look.validate`."""

    materials: NotRequired[Mapping[str, MaterialLook]]
    environment: NotRequired[EnvironmentLook]
    background: NotRequired[BackgroundLook]
    lights: NotRequired[Mapping[str, PointLook | SpotLook | DirectionalLook | RectangleLook | DiscLook | SphereLook | TubeLook | MeshLook | PointsLook | PanelsLook | DirectionalsLook | SurfacesLook]]
    light_groups: NotRequired[Mapping[str, LightGroupLook]]
    transport: NotRequired[TransportLook]
    display: NotRequired[DisplayLook]


class LookEntry(TypedDict):
    """A saved look in a list. `created`: when it was first saved, the sort key of editors. `thumbnail`: URL of this
    version's image, relative to the server, null if there is none. `view`: saved with the look, null if none was."""

    name: str
    etag: str
    created: str
    modified: str
    bytes: int
    thumbnail: str | None
    view: LookView | None


class LookView(TypedDict):
    """The view of a saved look: a view by name, and the pose of its free camera; null: as baked."""

    view: str
    camera: NotRequired[CameraFrame | None]


class LooksBody(TypedDict):
    """Complete look and camera of each frame; cameras are null without a `path`."""

    looks: Sequence[LookDocument]
    cameras: Sequence[CameraFrame] | None
    crosses: str | None


class MaterialLook(TypedDict):
    """A material: the sum of its terms."""

    terms: NotRequired[Sequence[TermLook]]
    shadow_catcher: NotRequired[bool]
    normal_map: NotRequired[NormalMapLook | None]
    uv: NotRequired[UvLook | None]
    glass: NotRequired[GlassLook | None]
    basis_functions: NotRequired[Literal[1, 3, 6, 10, 15, 21, 28, 36] | None]
    base: NotRequired[str | None]
    objects: NotRequired[Sequence[str]]


class MeshLook(TypedDict):
    """All surfaces of a material emit and are visible; emission is radiance."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["mesh"]]
    material: NotRequired[str]
    image: NotRequired[str | None]


class ModelBody(TypedDict):
    """A BRDF model; `texture` is its default texture channel, `needs_data` whether it is measured, `width_parameter`
    the parameter that roughness maps scale, `width_power` the power of roughness that it grows with, `specular_below`
    the value below which it is a mirror, and `data_prefix` the prefix of its data names (see `data`)."""

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
    parameters: Sequence[ParameterBody]
    curves: Sequence[CurveBody]


class NormalMapLook(TypedDict):
    """An uploaded image that replaces a material's normal map: "image:<id>", and its strength as glTF's `scale`."""

    image: NotRequired[str]
    scale: NotRequired[float]


class OcioView(TypedDict):
    """A view of a display of the server's OpenColorIO config, instead of a tone map."""

    display: NotRequired[str]
    view: NotRequired[str]


class PanelsLook(TypedDict):
    """Many area lights of the scene as one source, its `source`; emission is their mean radiance by area."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["panels"]]
    source: NotRequired[str]


class ParameterBody(TypedDict):
    """A numeric parameter that generates curves; `scale` is the scale of its slider."""

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


class PatchOperation(TypedDict):
    """One operation of a JSON Patch (RFC 6902) on the look."""

    op: Literal["replace", "add", "remove", "test"]
    path: str
    value: NotRequired[Any]


class PathAnswer(TypedDict):
    """server → client: `length` of a path to its first surface, meters, with its material and unit normal; null if the
    path is free."""

    type: Literal["path"]
    id: int
    length: float | None
    material: str | None
    normal: Sequence[float] | None
    solid: str | None


class Person(TypedDict):
    """A participant. `id`: constant while in the room. `online`: false while the connection is lost."""

    id: int
    name: str
    color: str
    material: str | None
    role: Literal["view", "edit", "admin"]
    online: bool


class PlanBody(TypedDict):
    """Cost of a bake. Upper bounds, except `store_bytes`, which is estimated from a sample and rounded up, and
    `seconds`, which is estimated from finished bakes and null if there are none."""

    view_samples: int
    rays: int
    store_bytes: int
    peak_bytes: int
    seconds: float | None


class PointLook(TypedDict):
    """A point light that emits equally in all directions; emission is radiant intensity, W/sr."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["point"]]
    position: NotRequired[Sequence[float]]
    direction: NotRequired[Sequence[float]]
    rotation: NotRequired[float]
    profile: NotRequired[str | None]


class PointsLook(TypedDict):
    """Many point and spot lights of the scene as one source, its `source`; emission is their mean intensity, W/sr."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["points"]]
    source: NotRequired[str]


class PongMessage(TypedDict):
    """server → client: answer to a `PingMessage`."""

    type: Literal["pong"]


class Problem(TypedDict):
    """RFC 9457 problem. `type` is the kind, `detail` says what happened and what to do."""

    type: str
    title: str
    status: int
    detail: str


class ProblemMessage(TypedDict):
    """server → client: a message was rejected; the look is unchanged."""

    type: Literal["problem"]
    revision: int | None
    problem: Problem


class RecipeBody(TypedDict):
    """The complete recipe; `cameras` are those of placed or custom `views`. `probes`: null for fixed cameras.
    `patches`, `gather_rays`: null if the method chooses."""

    method: str
    views: Sequence[str]
    size: Sequence[int]
    lights: int
    probes: int | None
    patches: int | None
    gather_rays: int | None
    relightable: bool
    cameras: Sequence[CameraBody]


class RectangleLook(TypedDict):
    """A rectangular area light that emits toward `direction`; emission is radiance. The camera does not see it."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["rectangle"]]
    position: NotRequired[Sequence[float]]
    direction: NotRequired[Sequence[float]]
    rotation: NotRequired[float]
    size: NotRequired[Sequence[float]]


class RenderBody(TypedDict):
    """A batch; `completed` of `total` frames are finished, `progress` 0…1 includes part of the current one."""

    id: str
    name: str | None
    user: str
    bake: str
    view: str | None
    views: Sequence[BakeView]
    format: Literal["exr", "png", "webp", "mp4", "contact_sheet"]
    size: Sequence[int] | None
    priority: int
    warnings: Sequence[str]
    state: Literal["queued", "running", "ready", "failed", "canceled"]
    created: str
    started: str | None
    ended: str | None
    completed: int
    total: int
    progress: float
    seconds_left: float | None
    problem: str | None
    baking: float | None


class RenderOptions(TypedDict):
    """Optional fields of a request."""

    frames: NotRequired[int | None]
    durations: NotRequired[Sequence[float] | None]
    interpolation: NotRequired[Literal["parameters", "map", "map_low"]]
    path: NotRequired[Turntable | CameraPath | None]
    look_names: NotRequired[Sequence[str]]
    saved_looks: NotRequired[Sequence[str]]
    views: NotRequired[Sequence[BakeView]]
    size: NotRequired[Sequence[int] | None]
    saved_views: NotRequired[bool]
    rebake: NotRequired[bool]
    name: NotRequired[str | None]
    file_name: NotRequired[str | None]
    start_frame: NotRequired[int]
    frame_step: NotRequired[int]
    priority: NotRequired[int]
    webhook: NotRequired[str | None]
    layers: NotRequired[bool | Literal["light_groups"]]
    aovs: NotRequired[bool]
    precision: NotRequired[Literal["half", "float"]]
    color_space: NotRequired[str | None]
    fps: NotRequired[int]
    quality: NotRequired[Literal["exact", "interactive"]]


class RoomInfo(TypedDict):
    """The room of a session. `id` opens it for editing, null for view-only participants; `view_token` opens it
    view-only. `participant_token` rejoins as the same participant, `self_id` is its id. `is_new`: the room was empty,
    so it has the look of this session. `default_look`: the scene's default look."""

    id: str | None
    view_token: str
    participant_token: str
    self_id: int
    is_new: bool
    people: Sequence[Person]
    default_look: Mapping[str, Any]


class RoomMessage(TypedDict):
    """server → client: current participants; `self_id` is oneself."""

    type: Literal["room"]
    self_id: int
    people: Sequence[Person]


class RoomUpdate(TypedDict):
    """server → client: changes of the room's look since the last such message, or `hello`, including this session's own
    edits up to `revision`. The `patch` is empty if there were no others. `room_revision` counts the changes, and frames
    repeat it. `edited_by`: ids of the participants who edited."""

    type: Literal["room_update"]
    revision: int
    room_revision: int
    patch: Sequence[SharedOperation]
    edited_by: Sequence[int]


class SceneBody(TypedDict):
    """A scene; `materials` in the order of the ids in `/views/{view}/materials.png`, `bakes` newest first."""

    id: str
    name: str
    created: str
    views: Sequence[SceneView]
    materials: Sequence[SceneMaterial]
    lights: Sequence[str]
    objects: Sequence[str]
    variants: Sequence[SceneVariant]
    warnings: Sequence[SceneWarning]
    import_options: ImportOptions
    size: Sequence[float] | None
    triangles: int
    thumbnail: str | None
    bakes: Sequence[str]


class SceneMaterial(TypedDict):
    """A material and its default terms, as in look documents."""

    name: str
    terms: Sequence[Mapping[str, Any]]
    shadow_catcher: bool
    is_projected: bool
    is_glass: bool
    is_textured: bool
    objects: Sequence[str]


class SceneUpdate(TypedDict):
    """Shader constants of a look, besides arrays. `gain`: of the image; `environment_gain`, `background_gain`: of the
    prefiltered environment for lobes, and of the background, per channel. `environment_rotation`: added to u.
    `environment_mips`: first texel, height and width of each. `bright_lights`: bright environment lights, which lobes
    evaluate separately: direction, radiance, spread. `shows_direct`: direct light and the background are visible.
    `arrays`: those in the payload; all others are unchanged."""

    gain: Sequence[float]
    environment_gain: Sequence[float]
    background_gain: Sequence[float]
    environment_rotation: float
    environment_mips: Sequence[Sequence[int]]
    bright_lights: Sequence[Sequence[float]]
    background: Literal["map", "blurred", "color", "transparent"]
    background_color: Sequence[float]
    background_size: Sequence[int]
    shows_direct: bool
    arrays: Sequence[ArrayInfo]


class SceneVariant(TypedDict):
    """A material variant of the scene's file, as a partial look document."""

    name: str
    look: Mapping[str, Any]


class SceneView(TypedDict):
    """A camera; `aspect` is width ÷ height. `is_placed`: placed by a user, not from the scene's file."""

    name: str
    aspect: float
    is_placed: bool


class SceneWarning(TypedDict):
    """An import warning. `severity`: the feature is missing or wrong in the image ("unsupported"), looks much the same
    ("approximated"), or does not change the image ("ignored"). `where`: the part of the file, empty for all of it."""

    text: str
    severity: Literal["unsupported", "approximated", "ignored"]
    where: str


class SharedOperation(TypedDict):
    """One operation of a change of the shared look. A path may already exist for `add`, or be missing for `remove`."""

    op: Literal["replace", "add", "remove"]
    path: str
    value: Any


class ShortfallBody(TypedDict):
    """A part of the target that cannot be reached. `stroke`: its index, null for a whole reference picture. `cause`:
    all lights that reach it are `locked`; `no_light` reaches it; or lights that do, reach other pixels, too
    (`conflict`). `asked_stops`, `reached_stops`: change of its mean luminance, null from or to black."""

    stroke: int | None
    residual: float
    cause: Literal["locked", "no_light", "conflict"]
    asked_stops: float | None
    reached_stops: float | None


class SolveBody(TypedDict):
    """The solution. `patch`: JSON Patch on the complete look; `look`: the look of the request with these changes.
    `changes`: changed lights; `materials`: names of changed materials, whose terms the patch replaces. `residual`,
    `residual_before`: relative RMS error of the marked pixels; 0 if none are marked."""

    patch: Sequence[PatchOperation]
    look: Mapping[str, Any]
    residual: float
    residual_before: float
    changes: Sequence[SourceChange]
    materials: Sequence[str]
    shortfalls: Sequence[ShortfallBody]


class SolveOptions(TypedDict):
    """Optional fields of a request."""

    camera: NotRequired[CameraFrame | None]
    size: NotRequired[Sequence[int] | None]
    strokes: NotRequired[Sequence[StrokeBody]]
    locked: NotRequired[Sequence[str]]
    change: NotRequired[Literal["intensity", "color"] | None]
    rotate: NotRequired[bool]
    materials: NotRequired[Sequence[str]]


class SourceChange(TypedDict):
    """Change of a light. `pointer`: JSON pointer of the light in the look. `stops`: of its luminance; null from or to
    black."""

    pointer: str
    stops: float | None


class SphereLook(TypedDict):
    """A sphere; emission is radiance. The camera does not see it. `radius`: meters."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["sphere"]]
    position: NotRequired[Sequence[float]]
    radius: NotRequired[float]


class SpotLook(TypedDict):
    """A point light with inner and outer cone half-angles in degrees; emission is intensity on the axis, W/sr."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["spot"]]
    position: NotRequired[Sequence[float]]
    direction: NotRequired[Sequence[float]]
    cone: NotRequired[Sequence[float]]
    rotation: NotRequired[float]
    profile: NotRequired[str | None]
    gobo: NotRequired[str | None]


class StatusMessage(TypedDict):
    """server → client: something takes time; `progress` 0…1. A curve is precomputed for edits (`label` names it), or a
    term is shaded for the first time; "ready" ends it. Other work continues meanwhile."""

    type: Literal["status"]
    state: Literal["precomputing", "shading", "ready"]
    view: str
    label: str
    progress: float


class StrokeBody(TypedDict):
    """A stroke of a brush over the image: `brighter` or `darker` by `stops`; in a `color` (linear Rec. 709) at equal
    luminance; or as the `reference` picture there."""

    kind: Literal["brighter", "darker", "color", "reference"]
    points: NotRequired[Sequence[Sequence[float]]]
    radius: NotRequired[float]
    mask: NotRequired[str | None]
    stops: NotRequired[float]
    color: NotRequired[Sequence[float]]


class SurfaceNames(TypedDict):
    """Surfaces by name: all of some materials, and all of some objects. Objects are the meshes of the scene."""

    materials: NotRequired[Sequence[str]]
    objects: NotRequired[Sequence[str]]


class SurfacesLook(TypedDict):
    """All surfaces of several materials of the scene as one source; emission is their mean radiance by area."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["surfaces"]]
    materials: NotRequired[Sequence[Sequence[str | Sequence[float]]]]


class TermLook(TypedDict):
    """One term: color · texture · quotient · Π curves. Drawn curves replace those generated from `params`."""

    model: NotRequired[str]
    data: NotRequired[str]
    color: NotRequired[Sequence[float]]
    texture: NotRequired[str | None]
    roughness_map: NotRequired[str | None]
    params: NotRequired[Mapping[str, float | Sequence[float]]]
    curves: NotRequired[Mapping[str, DrawnCurve | Sequence[DrawnCurve]]]


class TransportLook(TypedDict):
    """Light paths to show: all, direct, indirect, first bounce or further bounces, with at most `bounces` bounces."""

    show: NotRequired[Literal["all", "direct", "indirect", "first_bounce", "further_bounces"]]
    bounces: NotRequired[int]


class TubeLook(TypedDict):
    """A tube, whose side emits and whose ends do not; emission is radiance. The camera does not see it."""

    intensity: NotRequired[float]
    color: NotRequired[Sequence[float]]
    enabled: NotRequired[bool]
    emission: NotRequired[Sequence[float]]
    link: NotRequired[IncludeLink | ExcludeLink | None]
    shadow_link: NotRequired[IncludeLink | ExcludeLink | None]
    kind: NotRequired[Literal["tube"]]
    position: NotRequired[Sequence[float]]
    direction: NotRequired[Sequence[float]]
    radius: NotRequired[float]
    length: NotRequired[float]


class Turntable(TypedDict):
    """One revolution about a vertical axis, in so many frames; `start_camera`: of the first frame, by default the
    view's."""

    turntable: int
    start_camera: NotRequired[CameraFrame | None]
    pivot: NotRequired[Sequence[float] | None]
    rotate: NotRequired[Literal["camera", "object", "environment"]]


class UvLook(TypedDict):
    """Transform of a material's texture coordinates: `scale`, then `rotation` in degrees, then `offset`, as in glTF's
    KHR_texture_transform. See `relume.math.uv_transform`."""

    scale: NotRequired[Sequence[float]]
    rotation: NotRequired[float]
    offset: NotRequired[Sequence[float]]


class ViewInfo(TypedDict):
    """A view, its size in pixels and its camera; `camera_mode`: fixed at the baked camera, or free. For a free camera
    `bounds` are the minimum and maximum corner of the scene, meters, and `interior_camera` is in its largest room."""

    name: str
    width: int
    height: int
    camera: CameraInfo
    camera_mode: Literal["fixed", "free"]
    bounds: Sequence[Sequence[float]] | None
    interior_camera: CameraInfo | None
