"""State of a bake as the ledger reports it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any, Literal

from relume.core.source_hash import bake_code
from relume.scene.custom_camera import read_custom_camera
from relume.store.bake_protocol import Plan, Recipe
from relume.store.schema import SCHEMA_VERSION
from relume_worker.job_state import FINAL_STATES, JobState

Phase = Literal["starting", "loading", "reading", "building", "compiling", "sampling", "tracing", "publishing"]
PHASE_LABELS: dict[Phase, str] = {
    "starting": "starting worker processes",
    "loading": "loading the kernels",
    "reading": "reading the scene",
    "building": "building the ray-tracing structure",
    "compiling": "compiling kernels, once on this machine",
    "sampling": "finding the visible surfaces of each pixel",
    "tracing": "tracing",
    "publishing": "checking and publishing",
}

# methods with a free camera: their images are exact once it stops, not at once
FREE_CAMERA_METHODS = frozenset({"probes"})


@dataclass(frozen=True)
class BakeStatus:
    """State of a bake at one moment.

    Attributes:
        progress: 0 to 1.
        phase: current phase, None if it is not running. phase_since: seconds since 1970.
        queue_position: number of bakes before it, if it is queued.
        rays_per_second, seconds_left: None if nothing has been measured yet.
        bytes: size of the published store, 0 before.
        problem: one sentence with a remedy, or why it has restarted; None if there is no problem.
        code: code version that makes or made it; None if unknown.
        created: seconds since 1970.
        client: first user who submitted it; "" if unknown, or without login.
    """

    id: str
    scene: str
    state: JobState
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
        """True if baking again would give the same result, because the code version is the same."""
        return self.code == bake_code()

    @property
    def rank(self) -> tuple[bool, int, bool]:
        """Sort key of a scene's bakes, the best last: exact while moving, then the finest, then the current code."""
        return self.recipe.method not in FREE_CAMERA_METHODS, self.detail, self.is_current

    @property
    def detail(self) -> int:
        """Pixels times lights: the fineness of a bake."""
        width, height = self.recipe.size
        return width * height * self.recipe.num_lights

    @property
    def final(self) -> bool:
        """True if nothing more happens by itself."""
        return self.state in FINAL_STATES


@dataclass(frozen=True)
class TaskCost:
    """Cost of a finished task.

    Attributes:
        trace_s: seconds in the tracing kernels. seconds: total, including writing.
    """

    rays: int
    trace_s: float
    seconds: float


def recipe_json(recipe: Recipe) -> str:
    """Encode a recipe as canonical JSON: equal recipes give equal text."""
    return json.dumps(asdict(recipe), sort_keys=True, separators=(",", ":"))


def recipe_from_json(text: str) -> Recipe:
    """Inverse of `recipe_json`."""
    document: dict[str, Any] = json.loads(text)
    width, height = document["size"]
    return Recipe(
        str(document["method"]),
        tuple(document["views"]),
        (width, height),
        int(document["num_lights"]),
        bool(document["relightable"]),
        tuple(read_custom_camera(camera) for camera in document.get("cameras", ())),  # recipes from before this field
        int(document.get("num_probes", Recipe.num_probes)),
        document.get("num_patches"),
        document.get("gather_rays"),
    )


def bake_id(scene_id: str, recipe: Recipe) -> str:
    """Id of a bake: the first 16 hexadecimal digits of SHA-256 over scene, recipe, schema version and code."""
    text = json.dumps([scene_id, recipe_json(recipe), SCHEMA_VERSION, bake_code()])
    return hashlib.sha256(text.encode()).hexdigest()[:16]
