"""What the ledger knows about a bake, as everybody outside sees it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any, Literal

from relume.core.source_hash import bake_code
from relume.scene.custom_camera import read_custom_camera
from relume.store.bake_protocol import Plan, Recipe
from relume.store.schema import SCHEMA_VERSION

BakeState = Literal["queued", "running", "ready", "failed", "cancelled"]
Phase = Literal["starting", "loading", "reading", "building", "compiling", "sampling", "tracing", "publishing"]
PHASE_LABELS: dict[Phase, str] = {
    "starting": "starting worker processes",
    "loading": "loading the kernels",
    "reading": "reading the scene",
    "building": "sorting its triangles for tracing",
    "compiling": "compiling kernels, once on this machine",
    "sampling": "finding what each pixel sees",
    "tracing": "tracing",
    "publishing": "checking and publishing",
}
FINAL_STATES: frozenset[BakeState] = frozenset({"ready", "failed", "cancelled"})

# methods with a free camera: their images are exact once it stops, not at once
FREE_CAMERA_METHODS = frozenset({"probes"})


@dataclass(frozen=True)
class BakeStatus:
    """One bake at one moment.

    Attributes:
        progress: 0 to 1.
        phase: what it does now, None where it does not run. phase_since: seconds since 1970.
        queue_position: bakes that will run before it, where it is queued.
        rays_per_second, seconds_left: None where nothing was measured yet.
        bytes: size of the published store, 0 before.
        problem: one sentence with what to do about it, or why it has started again; None where all is well.
        code: names the code that makes or made it; None where that was not written down yet.
        created: seconds since 1970.
        client: who asked for it first; "" where that was not written down, or nobody logs in.
    """

    id: str
    scene: str
    state: BakeState
    progress: float
    phase: Phase | None
    phase_since: float | None
    queue_position: int
    rays_per_second: float | None
    seconds_left: float | None
    bytes: int
    problem: str | None
    recipe: Recipe
    plan: Plan
    created: float
    code: str | None
    client: str = ""

    @property
    def is_current(self) -> bool:
        """Whether baking it anew would give the same: no other code has made it."""
        return self.code == bake_code()

    @property
    def rank(self) -> tuple[bool, int, bool]:
        """Sorts a scene's bakes, the best last: one whose pictures are exact at once, the finest, then one that this
        code has made."""
        return self.recipe.method not in FREE_CAMERA_METHODS, self.detail, self.is_current

    @property
    def detail(self) -> int:
        """Pixels times lights: what makes a bake finer."""
        width, height = self.recipe.size
        return width * height * self.recipe.num_lights

    @property
    def final(self) -> bool:
        """Whether nothing more happens by itself."""
        return self.state in FINAL_STATES


@dataclass(frozen=True)
class TaskCost:
    """What a finished task took.

    Attributes:
        trace_s: seconds in the tracing kernels. seconds: all of it, writing included.
    """

    rays: int
    trace_s: float
    seconds: float


def recipe_json(recipe: Recipe) -> str:
    """A recipe as canonical JSON: equal recipes give equal text."""
    return json.dumps(asdict(recipe), sort_keys=True, separators=(",", ":"))


def recipe_from_json(text: str) -> Recipe:
    """The inverse of `recipe_json`."""
    document: dict[str, Any] = json.loads(text)
    width, height = document["size"]
    return Recipe(
        str(document["method"]),
        tuple(document["views"]),
        (width, height),
        int(document["num_lights"]),
        bool(document["relightable"]),
        tuple(read_custom_camera(camera) for camera in document.get("cameras", ())),  # recipes of before there were any
        int(document.get("num_probes", Recipe.num_probes)),
        document.get("num_patches"),
        document.get("gather_rays"),
    )


def bake_id(scene_id: str, recipe: Recipe) -> str:
    """Name of a bake: the first 16 hexadecimal digits of SHA-256 over scene, recipe, schema version and code."""
    text = json.dumps([scene_id, recipe_json(recipe), SCHEMA_VERSION, bake_code()])
    return hashlib.sha256(text.encode()).hexdigest()[:16]
