"""Bodies of REST requests and responses."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from relume.core.import_warnings import Severity
from relume.look.document import MAX_BOUNCES
from relume.look.model import PathFilter
from relume.scene_io.import_options import ImportOptions
from relume_server.schemas.base import Body, Id, Name
from relume_server.schemas.cameras import CameraBody, CameraFrame, LookView
from relume_server.schemas.comments import MAX_PICTURE_TEXT
from relume_server.schemas.protocol import MAX_VISIBLE_VIEWS
from relume_server.schemas.renders import Side
from relume_worker.job_state import JobState
from relume_worker.status import Phase

Preset = Literal["preview", "good", "final"]


def format_timestamp(posix_s: float) -> str:
    """Format a time as ISO 8601, UTC."""
    return datetime.fromtimestamp(posix_s, UTC).isoformat()


class SceneView(Body):
    """A camera; `aspect` is width ÷ height. `is_placed`: placed by a user, not from the scene's file."""

    name: str
    aspect: float
    is_placed: bool


class SceneMaterial(Body):
    """A material and its default terms, as in look documents.

    `catcher`: it is the ground, which looks may show as a shadow catcher. `is_projected`: most of its triangles have no
    texture coordinates and use a projection. `is_glass`: it transmits light, as defined by the scene's file; looks
    edit its glass, but cannot make other materials transmit. `is_textured`: it has an image of the scene's file.
    `objects`: names of its objects; empty as those of the scene.
    """

    name: str
    terms: list[dict[str, Any]]
    shadow_catcher: bool
    is_projected: bool
    is_glass: bool
    is_textured: bool
    objects: list[str]


class SceneVariant(Body):
    """A material variant of the scene's file, as a partial look document."""

    name: str
    look: dict[str, Any]


class SceneWarning(Body):
    """An import warning. `severity`: the feature is missing or wrong in the image ("unsupported"), looks much the same
    ("approximated"), or does not change the image ("ignored"). `where`: the part of the file, empty for all of it.
    """

    text: str
    severity: Severity
    where: str


class SceneBody(Body):
    """A scene; `materials` in the order of the ids in `/views/{view}/materials.png`, `bakes` newest first.

    `warnings`: most severe first. `import_options`: for the next import of its file. `size`: sides of its bounding box
    along x, y and z without a shadow catcher, meters; null for a scene of an older version. `objects`: names for the
    links of lights; empty for a scene of an older version, or with more than 2,000.
    """

    id: str
    name: str
    created: str
    views: list[SceneView]
    materials: list[SceneMaterial]
    lights: list[str]
    objects: list[str]
    variants: list[SceneVariant]
    warnings: list[SceneWarning]
    import_options: ImportOptions
    size: tuple[float, float, float] | None
    triangles: int
    thumbnail: str | None
    bakes: list[str]


class ExampleSceneBody(Body):
    """A built-in scene; `size` and `method` suit its bake."""

    name: str
    label: str
    description: str
    size: tuple[int, int]
    method: str


class MaterialBody(Body):
    """A library material under one model, as terms for a look and as a list entry.

    `id` is "table/material", `group` its category, `model` that of its highlight, `swatch` its color "#rrggbb".
    """

    id: str
    name: str
    group: str
    model: str
    source: str
    swatch: str
    terms: list[dict[str, Any]]


class MapPoint(Body):
    """A material in the plane of reflectance at normal incidence and roughness; `id` is that of its library entry."""

    id: str
    f0: float
    sigma: float


class MaterialMapBody(Body):
    """Sun's navigation map; `triangles` are indices of points, counter-clockwise with x = f0 and y = log sigma."""

    points: list[MapPoint]
    triangles: list[tuple[int, int, int]]


class MeasuredBody(Body):
    """A measured material; looks refer to it by `data`, `terms` are its initial terms.

    `lobes_error` (measured_lv + measured_hd) and `homomorphic_error` (measured_hf): of the curves alone, per channel.
    `warnings`: what the conversion from another layout than MERL changed.
    """

    id: str
    data: str
    name: str
    created: str
    terms: list[dict[str, Any]]
    thumbnail: str
    lobes_error: tuple[float, float, float]
    homomorphic_error: tuple[float, float, float]
    warnings: list[str]


class LibraryMaterialBody(Body):
    """One material of an imported file. `terms`: complete, with uploaded images as textures. `normal_map`, `glass`: as
    in a look, null if it has none; `glass` applies to objects that are glass in the scene."""

    name: str
    terms: list[dict[str, Any]]
    normal_map: dict[str, Any] | None
    glass: dict[str, Any] | None
    thumbnail: str


class ImportedBody(Body):
    """A file with materials. `warnings`: most severe first."""

    id: str
    name: str
    created: str
    materials: list[LibraryMaterialBody]
    warnings: list[SceneWarning]


class BtfBody(Body):
    """A BTF; looks refer to it by `data`, `terms` are its initial terms.

    `synthetic` describes the geometry that it was rendered from; null if it was measured. `error` is the relative RMS
    of the compression by number of components, starting with none; `ratio` is the compression ratio. It takes
    `memory_bytes` while it is shown.
    """

    id: str
    data: str
    name: str
    created: str
    terms: list[dict[str, Any]]
    thumbnail: str
    synthetic: str | None
    size: tuple[int, int]
    directions: int
    clusters: int
    components: int
    error: tuple[float, ...]
    ratio: float
    memory_bytes: int


class EnvironmentBody(Body):
    """An environment that looks can use instead of the scene's own, by `map`; `created` is null for built-in ones.

    `warnings`: changes made when its file was read.
    """

    id: str
    map: str
    name: str
    created: str | None
    warnings: list[str]
    thumbnail: str


class BakeRequest(Body):
    """A bake to queue. The preset gives size and lights; explicit fields override it. `aspect`: width ÷ height of the
    image with as many pixels as the preset's; ignored with `size`.

    `views`: names of the scene's cameras, or cameras, which become part of the recipe; default: all cameras of the
    file. `probes`: surface probes of a free camera (method `probes`); refused for fixed cameras. `patches`: surface
    patches of indirect light; `gather_rays`: per view sample or probe; by default both fit the image size (methods
    `gather` and `probes`). `relightable`: tile the environment so that rotating or replacing it causes little error.
    """

    scene: Id
    method: Name = "gather"
    views: Annotated[list[Name | CameraBody], Field(min_length=1, max_length=64)] | None = None
    preset: Preset | None = None
    aspect: Annotated[float, Field(ge=0.125, le=8)] | None = None
    size: tuple[Side, Side] | None = None
    lights: Annotated[int, Field(ge=1, le=100_000)] | None = None
    probes: Annotated[int, Field(ge=1, le=10_000_000)] | None = None
    patches: Annotated[int, Field(ge=1, le=10_000_000)] | None = None
    gather_rays: Annotated[int, Field(ge=1, le=100_000)] | None = None
    relightable: bool = False
    dry_run: bool = False


class PlanBody(Body):
    """Cost of a bake. Upper bounds, except `store_bytes`, which is estimated from a sample and rounded up, and
    `seconds`, which is estimated from finished bakes and null if there are none.
    """

    view_samples: int
    rays: int
    store_bytes: int
    peak_bytes: int
    seconds: float | None


class RecipeBody(Body):
    """The complete recipe; `cameras` are those of placed or custom `views`. `probes`: null for fixed cameras.
    `patches`, `gather_rays`: null if the method chooses.
    """

    method: str
    views: list[str]
    size: tuple[int, int]
    lights: int
    probes: int | None
    patches: int | None
    gather_rays: int | None
    relightable: bool
    cameras: list[CameraBody]


class BakeBody(Body):
    """A bake; `progress` 0…1, `problem` is a sentence if it failed or had to restart.

    `phase`: current step, for `phase_seconds` already. `queue_position`: number of bakes before a queued one.
    `is_current`: made by the server's own code version (`code`); older bakes can be used, but might differ if they were
    baked again. `user`: who submitted it first, `created`: when.
    """

    id: str
    user: str
    created: str
    scene: str
    state: Literal["queued", "running", "ready", "failed", "canceled"]
    progress: float
    phase: Phase | None
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


class DryRunBody(Body):
    """Response to a dry run: nothing was queued."""

    id: str
    recipe: RecipeBody
    plan: PlanBody


class RenderPlanBody(Body):
    """Response to a dry run: nothing was queued.

    `file_names`: of the first images, of `total`. `bytes`: upper bound of all files. `bakes`: bakes that the render
    starts and waits for, with their costs.
    """

    file_names: list[str]
    total: int
    bytes: int
    warnings: list[str]
    bakes: list[DryRunBody]


class LookEntry(Body):
    """A saved look in a list. `created`: when it was first saved, the sort key of editors. `thumbnail`: URL of this
    version's image, relative to the server, null if there is none. `view`: saved with the look, null if none was.
    """

    name: str
    etag: str
    created: str
    modified: str
    bytes: int
    thumbnail: str | None
    view: LookView | None


class ThumbnailRequest(Body):
    """A thumbnail of a look: a PNG, JPEG or WebP in Base64, at most 1024 pixels a side; stored smaller."""

    picture: Annotated[str, Field(max_length=MAX_PICTURE_TEXT)]


class SharedPaths(Body):
    """Visible light paths; as a look's `transport`."""

    show: PathFilter
    bounces: Annotated[int, Field(ge=0, le=MAX_BOUNCES)]


class ShareRequest(Body):
    """Content of a share link: a look of a bake, the views side by side, and the focused one.

    `solo`, `solo_light`: the material or the light ("" is the environment) that is shown alone. `paths`: visible light
    paths; null: those of the look. `cameras`: free cameras by view; `sizes`: image sizes in pixels by view, if not the
    baked size.
    """

    bake: Id
    view: Name
    views: Annotated[list[Name], Field(min_length=1, max_length=MAX_VISIBLE_VIEWS)]
    look: dict[str, Any]
    solo: Name | None = None
    solo_light: Annotated[str, Field(max_length=256)] | None = None
    paths: SharedPaths | None = None
    cameras: Annotated[dict[Name, CameraFrame], Field(default_factory=dict, max_length=MAX_VISIBLE_VIEWS)]
    sizes: Annotated[dict[Name, tuple[Side, Side]], Field(default_factory=dict, max_length=MAX_VISIBLE_VIEWS)]


class ShareEntry(Body):
    """A new share link; `url` is relative to the server."""

    id: str
    url: str


class ShareListEntry(ShareEntry):
    """A share link in a list, with the size of its content."""

    created: str
    bytes: int


class ShareBody(ShareRequest):
    """Content of a share link; `missing`: one sentence for each deleted part of it."""

    id: str
    created: str
    scene: str
    missing: list[str]


class ComparisonRequest(Body):
    """Compare a look with the reference, in so many passes; errors are available from the second pass on.

    `paths`: "all" compares with all light paths of the scene, and with those of the bake's method; "method" only with
    the latter, which is faster. For a free camera: `camera` and `size` of the image; by default as baked.
    """

    bake: Id
    view: Name
    look: Annotated[dict[str, Any], Field(default_factory=dict)]
    camera: CameraFrame | None = None
    size: tuple[Side, Side] | None = None
    paths: Literal["all", "method"] = "all"
    passes: Annotated[int, Field(ge=2, le=1024)] = 16
    dry_run: bool = False


class ComparisonPlanBody(Body):
    """Response to a dry run: nothing was queued. `seconds`: duration once it starts.

    `is_measured`: false while no pass of this view has been timed and the estimate is from other views; ask again
    later.
    """

    passes: int
    seconds: float
    is_measured: bool


class ComparisonFigures(Body):
    """Errors, each relative to the RMS of the reference over pixels and channels; see docs/accuracy.md.

    `rmse`: of the difference. `noise`: of the reference. `error`: of the frame, with the noise removed, and its
    `standard_error`: null if below the noise; `error_upper_bound` is its upper bound then.
    `significant_pixel_fraction`: fraction of pixels whose difference the noise does not explain, by chance at most 1 %.
    """

    rmse: float
    noise: float
    error: float | None
    standard_error: float | None
    error_upper_bound: float
    significant_pixel_fraction: float


class ComparisonBody(Body):
    """A comparison; `completed` of `total` passes are done. `seconds_left`: null if it is not running or nothing has
    been measured yet. `user`: who requested it; `created`, `started` and `ended` are times; null: not yet.

    `error_all_paths`: against all light paths, null if only the method's were requested; `error_method_paths`: against
    those of the method. `omitted_paths`: light paths of the look that the method does not simulate;
    `unsupported_paths`: light paths that the reference does not simulate either. Sentences; both empty before the first
    pass.
    """

    id: str
    user: str
    bake: str
    view: str
    state: JobState
    created: str
    started: str | None
    ended: str | None
    completed: int
    total: int
    progress: float
    seconds_left: float | None
    paths: Literal["all", "method"]
    omitted_paths: list[str]
    unsupported_paths: list[str]
    error_all_paths: ComparisonFigures | None
    error_method_paths: ComparisonFigures | None
    problem: str | None
