"""Bodies of the REST calls: what is accepted and what is answered."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from pydantic import Field

from relume.core.import_warnings import Severity
from relume.look.document import MAX_BOUNCES
from relume.look.model import PathFilter
from relume_server.schemas.base import Body, Id, JobState, Name
from relume_server.schemas.cameras import CameraBody, CameraFrame
from relume_server.schemas.comments import MAX_PICTURE_TEXT
from relume_server.schemas.protocol import MAX_VISIBLE_VIEWS
from relume_server.schemas.renders import Side
from relume_worker.status import Phase

Preset = Literal["preview", "good", "final"]


def format_timestamp(posix_s: float) -> str:
    """A time as all bodies write it: ISO 8601, UTC."""
    return datetime.fromtimestamp(posix_s, UTC).isoformat()


class SceneView(Body):
    """A camera; `aspect` is width ÷ height. `is_placed`: somebody placed it, it did not come with the scene."""

    name: str
    aspect: float
    is_placed: bool


class SceneMaterial(Body):
    """A material and its default terms, in look-document form.

    `catcher`: it is the ground, which looks may show by its shadows alone. `is_projected`: most of its triangles
    have no texture coordinates, and take a projection. `is_glass`: light passes it, as the scene's file says and no
    look changes.
    """

    name: str
    terms: list[dict[str, Any]]
    shadow_catcher: bool
    is_projected: bool
    is_glass: bool


class SceneVariant(Body):
    """A look that came with the scene's file; partial, in look-document form."""

    name: str
    look: dict[str, Any]


class SceneWarning(Body):
    """A warning of the import. `severity`: what `text` is about is missing or wrong in the picture ("unsupported"),
    looks much the same ("approximated"), or does not change the picture ("ignored")."""

    text: str
    severity: Severity


class SceneBody(Body):
    """A scene; `materials` in the order of the ids in `/views/{view}/materials.png`, `bakes` newest first.

    `warnings`: the worst first.
    """

    id: str
    name: str
    created: str
    views: list[SceneView]
    materials: list[SceneMaterial]
    lights: list[str]
    variants: list[SceneVariant]
    warnings: list[SceneWarning]
    triangles: int
    thumbnail: str | None
    bakes: list[str]


class ExampleSceneBody(Body):
    """A scene made by code; `size` and `method` of a bake show it well."""

    name: str
    label: str
    description: str
    size: tuple[int, int]
    method: str


class MaterialBody(Body):
    """A library material under one model: what stands in a look, and how a list shows it.

    `id` is "table/material", `group` what it is made of, `model` that of its highlight, `swatch` its colour "#rrggbb".
    """

    id: str
    name: str
    group: str
    model: str
    source: str
    swatch: str
    terms: list[dict[str, Any]]


class MapPoint(Body):
    """A material in the plane of reflectance seen head-on and roughness; `id` is that of its library entry."""

    id: str
    f0: float
    sigma: float


class MaterialMapBody(Body):
    """Sun's navigation map; `triangles` are indices of points, counter-clockwise where x is f0 and y is log sigma."""

    points: list[MapPoint]
    triangles: list[tuple[int, int, int]]


class MeasuredBody(Body):
    """A measured material; looks name it by `data`, `terms` is how it begins.

    `lobes_error` (measured_lv + measured_hd) and `homomorphic_error` (measured_hf): of the curves alone, per channel.
    """

    id: str
    data: str
    name: str
    created: str
    terms: list[dict[str, Any]]
    thumbnail: str
    lobes_error: tuple[float, float, float]
    homomorphic_error: tuple[float, float, float]


class BtfBody(Body):
    """A bidirectional texture; looks name it by `data`, `terms` is how it begins.

    `synthetic` says which geometry it was rendered from; null where it was measured. `error` is the relative RMS of the
    compression by how many components are used, from none on; `ratio` what is saved by it.
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


class EnvironmentBody(Body):
    """An environment that looks may name, by `map`, in place of the scene's own; `created` is null for a built-in one.

    `warnings`: what was changed when its file was read.
    """

    id: str
    map: str
    name: str
    created: str | None
    warnings: list[str]
    thumbnail: str


class BakeRequest(Body):
    """What to bake. A preset gives size and lights; what is named beside it wins. `aspect`: width ÷ height of the
    preset's picture, of as many pixels; beside a `size` it says nothing.

    `views`: names of the scene's cameras, or cameras, which become part of the recipe; all that came with the scene
    where none are named. `probes`: surface probes of a free camera (method `probes`); refused for fixed views, which
    have none.
    `patches`: surface patches that indirect light is stored for; `gather_rays`: of a view sample or probe; by default
    as many as fit the picture (methods `gather` and `probes`).
    `relightable`: divide the light so that turning or exchanging the environment errs little.
    """

    scene: Id
    method: Name = "direct"
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
    """What a bake will cost; upper bounds, but for `store_bytes`, on disk, as a little of it takes, rounded up; and
    `seconds`: judged by finished bakes, null where there are none."""

    view_samples: int
    rays: int
    store_bytes: int
    peak_bytes: int
    seconds: float | None


class RecipeBody(Body):
    """What was asked for, complete; `cameras` are those of the `views` that somebody placed. `probes`: null for fixed
    cameras. `patches`, `gather_rays`: null where the method chooses."""

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
    """A bake; `progress` 0…1, `problem` one sentence where it failed, or had to start again.

    `phase`: what it does while it runs, and for how many seconds already. `queue_position`: bakes that a queued one
    waits for.
    `is_current`: whether the code that made it, which `code` names, is the server's own; others can be used, but might
    come out otherwise if it were baked again. `user` asked for it first, `created` says when.
    """

    id: str
    user: str
    created: str
    scene: str
    state: Literal["queued", "running", "ready", "failed", "cancelled"]
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
    """The answer to a dry run: nothing was queued."""

    id: str
    recipe: RecipeBody
    plan: PlanBody


class LookEntry(Body):
    """A saved look in the list of them. `created`: when it was saved first, which editors sort by. `thumbnail`: address
    of the picture of this version, relative to the server, null where there is none."""

    name: str
    etag: str
    created: str
    modified: str
    bytes: int
    thumbnail: str | None


class ThumbnailRequest(Body):
    """A picture of a look: a PNG, JPEG or WebP in Base64, at most 1024 pixels a side; stored smaller."""

    picture: Annotated[str, Field(max_length=MAX_PICTURE_TEXT)]


class SharedPaths(Body):
    """Light paths that are looked at; as a look's `transport`."""

    show: PathFilter
    bounces: Annotated[int, Field(ge=0, le=MAX_BOUNCES)]


class ShareRequest(Body):
    """What a link shows: a look of a bake, the views beside each other and the one in hand.

    `solo`, `solo_light`: a material, a source of light ("" is the environment) that is shown alone. `paths`: the light
    paths that are looked at; null: those of the look. `cameras`: of views whose camera is free, by name;
    `sizes`: of their pictures, pixels, where they are not as large as was baked.
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
    """A link that was made; `url` is relative to the server."""

    id: str
    url: str


class ShareListEntry(ShareEntry):
    """A link in the list of them; what it shows takes so many bytes."""

    created: str
    bytes: int


class ShareBody(ShareRequest):
    """What a link shows; `missing`: what of it is not here any more, one sentence each."""

    id: str
    created: str
    scene: str
    missing: list[str]


class ComparisonRequest(Body):
    """Compare a look with brute force, in so many passes; figures come from the second on.

    `paths`: "all" that the scene has, and those that the bake's method follows beside them; or "method", these alone,
    which is sooner done. Where the eye moves: `camera`, from where it is seen, and `size` of the picture; by default as
    it was baked.
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
    """The answer to a dry run: nothing was queued. `seconds` that it will take, once it has its turn.

    `is_measured`: false where nothing of this view was timed yet, and pictures of others tell; ask again in a moment.
    """

    passes: int
    seconds: float
    is_measured: bool


class ComparisonFigures(Body):
    """Each relative to the truth's root mean square over pixels and channels; see docs/accuracy.md.

    `rmse` of the difference, `noise` of the brute force, `error` of the frame with the noise taken off, and its
    `standard_error`: null where that cannot be told from the noise, `error_upper_bound` is what it is below then.
    `significant_pixel_fraction`: share of pixels whose difference the noise does not explain, at most a hundredth of
    them by chance.
    """

    rmse: float
    noise: float
    error: float | None
    standard_error: float | None
    error_upper_bound: float
    significant_pixel_fraction: float


class ComparisonBody(Body):
    """A comparison; `completed` of `total` passes are done. `seconds_left`: null where it does not run or nothing was
    measured yet. `user` asked for it; `created`, `started` and `ended` are times; null: not yet.

    `error_all_paths`: against all light paths, null where only the method's were asked for; `error_method_paths`:
    against those that the method follows. `omitted_paths`: which paths the method leaves out of what the look shows;
    `unsupported_paths`: which brute force leaves out, too. In sentences; both are empty before the first pass.
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
