"""Fakes: a picture whose pixels are known, and a bake method without computation."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from relume.assets.environments.environment import Environment
from relume.core.cache import CacheOwner
from relume.core.errors import CancelledError, EditNotSupportedError, MemoryBudgetError
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.jobs import Job, Priority, ignore_result
from relume.live.fixed_camera.protocols import CameraMode, EditAxis
from relume.look import default_look
from relume.output.exr.aovs import AovTracer
from relume.output.viewport import Viewport
from relume.reference import ReferenceImage
from relume.scene.model import Camera, Material, Mesh, Scene
from relume.scene.scene_folder import load_scene, make_scene
from relume.store.bake_protocol import ArraySpec, Plan, Recipe, StoreReader, Task, TaskOutput
from relume.store.reader import open_store
from relume_server.batch.context import BatchContext
from relume_server.batch.step_registry import do_step
from relume_server.io.import_request import ImportRequest, _write_scene
from relume_server.runtime.protocols import Library
from relume_server.settings import Settings
from relume_worker.jobs.step import IsNeeded, ProgressCallback, Step

THETA_H, THETA_D = (f"/materials/Paper/terms/1/curves/{name}" for name in ("theta_h", "theta_d"))
TILE = 64
SIZE = (160, 96)
NUM_COEFFICIENTS = 16


def tiny_scene(name: str = "triangle") -> Scene:
    """One triangle with one material of a diffuse and a glossy term, and two views."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    normals = np.tile(np.array([[0, 0, 1]], np.float32), (3, 1))
    zeros = np.zeros((3, 4), np.float32)
    mesh = Mesh("m", positions, normals, zeros, zeros[:, :2].copy(), np.array([[0, 1, 2]], np.uint32), 0)
    terms = (
        {"model": "lambert", "color": [0.5, 0.5, 0.5]},
        {"model": "cook_torrance", "color": [1.0, 1.0, 1.0], "params": {"sigma": 0.2, "ior": 1.5, "extinction": 0.0}},
    )
    cameras = [Camera(view, np.eye(4), 0.8) for view in ("front", "left")]
    return make_scene(
        name, [mesh], [Material("Paper", terms)], cameras, Environment("gray", np.ones((4, 8, 3), np.float32))
    )


def write_tiny_scene(request: ImportRequest) -> str:
    """In slot of an import process: write the tiny scene, whatever the file is."""
    return _write_scene(request, tiny_scene())


@dataclass(frozen=True)
class FakeMethod:
    """One task per bake; it waits for `gate` if there is one."""

    gate: threading.Event | None = None
    name: str = "direct"
    stages: tuple[str, ...] = ("samples",)

    def plan(self, scene: Scene, recipe: Recipe) -> Plan:
        return Plan(recipe.size[0] * recipe.size[1], recipe.num_lights * 100, 1000, 1000)

    def prepare(self, scene: Scene) -> None:
        pass

    def attributes(self, scene: Scene, recipe: Recipe) -> dict[str, Any]:
        return {"method": self.name, "scene": scene.id, "views": list(recipe.views), "size": list(recipe.size)}

    def arrays(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[ArraySpec]:
        return [ArraySpec("values", (4,), "float32", (4,), (4,))]

    def tasks(self, stage: int, scene: Scene, recipe: Recipe, store: StoreReader) -> Sequence[Task]:
        return [Task(0, 0, "", 0, 4)]

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> TaskOutput:
        if self.gate is not None:
            self.gate.wait(30)
        return TaskOutput({"values": np.arange(4, dtype=np.float32)}, 10, 0.0)


@dataclass(frozen=True)
class FakeView:
    name: str
    width: int
    height: int
    camera: Camera = field(default_factory=lambda: Camera("front", np.eye(4), 0.8))

    def material_ids(self) -> np.ndarray:
        ids = np.zeros((self.height, self.width), np.uint16)
        ids[0, 0] = 65535
        return ids


@dataclass
class FakeTransfer:
    """The result of `open_transfer`."""

    scene_id: str
    views: dict[str, FakeView]
    method: str = "direct"
    default_look: dict[str, Any] = field(default_factory=lambda: default_look(tiny_scene().materials))
    material_names: list[str] = field(default_factory=lambda: ["Paper"])

    camera_mode: CameraMode = CameraMode.FIXED

    @property
    def axes(self) -> frozenset[EditAxis]:
        return frozenset([EditAxis.CURVE, *([EditAxis.BOUNCES] if self.method == "gather" else [])])

    def environment_radiance(self, name: str | None) -> np.ndarray:
        return np.ones((4, 8, 3), np.float32)


def fake_job(
    control: "Control",
    key: str,
    *,
    state: Literal["precomputing", "shading"] = "precomputing",
    priority: Priority = Priority.CONTROL,
    apply: Callable[[str], None] = ignore_result,
) -> Job:
    """The job of one curve; it waits for `control.freeze_gate`."""

    def run(progress: Callable[[float], None], is_canceled: Callable[[], bool]) -> str:
        control.freeze_started.set()
        progress(0.5)
        while not control.freeze_gate.wait(0.01):
            if is_canceled():
                control.num_cancelled += 1
                raise CancelledError("stopped")
        return key

    return Job(("curve", key), f"Paper, {key.rsplit('/', 1)[-1]}", priority, run, apply, state)


def make_advance(tiles: list[Any], exact: bool) -> SimpleNamespace:
    """The result of a step of a whole picture."""
    fidelity = Fidelity.EXACT if exact else Fidelity.APPROXIMATE
    fields = {"exact": exact, "fidelity": fidelity, "complete": True, "free_camera_error": None, "traces_lobes": False}
    return SimpleNamespace(tiles=tiles, changed=bool(tiles), **fields)


@dataclass
class FakePicture:
    """Radiance = lambert color + sigma everywhere, reached in steps. ior needs θd, which is not frozen initially."""

    transfer: FakeTransfer
    view: FakeView
    control: "Control"
    look: Any = None
    num_coefficients_used: int = 0
    frozen_curves: set[str] = field(default_factory=lambda: {THETA_H})
    active_pointer: str = THETA_H
    ior: float = 1.5

    def __post_init__(self) -> None:
        self.pixels = np.zeros((self.view.height, self.view.width, 3), np.float32)

    def set_look(self, look: Any, *, active_pointer: str | None, solo: frozenset[str] | None) -> None:
        if look.environment.rotation != 0.0:
            raise EditNotSupportedError("direct", "the environment's rotation")
        if self.look is None or sum_color_and_sigma(look) != sum_color_and_sigma(self.look):
            self.num_coefficients_used = 0
        self.look = look
        self.control.num_looks += 1
        self.control.controls.append(active_pointer)
        self.control.solos.append(solo)

    def look_at(self, region: tuple[int, int, int, int] | None) -> None:
        self.control.regions.append(region)

    def check(self, look: Any) -> None:
        if self.view.name in self.control.views_over_budget and get_ior(look) != self.ior:
            raise MemoryBudgetError("the curve", 2, 1, "close it")

    def prepare(self, pointer: str) -> None:
        if self.view.name in self.control.views_over_budget:
            raise MemoryBudgetError("the curve", 2, 1, "close it")
        self.active_pointer = pointer

    def next_job(self) -> Job | None:
        missing_curves = [THETA_D] if self._needs_theta_d() else []
        pending_curves = [curve for curve in (*missing_curves, self.active_pointer) if curve not in self.frozen_curves]
        if not pending_curves:
            return None
        priority = Priority.REFINEMENT if self.control.is_refinement else Priority.CONTROL
        return fake_job(self.control, pending_curves[0], priority=priority, apply=self.frozen_curves.add)

    def _needs_theta_d(self) -> bool:
        return self.look is not None and get_ior(self.look) != self.ior

    def advance(self, max_coefficients: int | None) -> Any:
        if self._needs_theta_d() and THETA_D in self.frozen_curves:
            self.ior, self.num_coefficients_used = get_ior(self.look), 0
        exact = not self._needs_theta_d()
        if self.num_coefficients_used >= NUM_COEFFICIENTS:
            return make_advance([], exact)
        budget = NUM_COEFFICIENTS if max_coefficients is None else min(max_coefficients, self.control.max_step)
        self.num_coefficients_used = min(NUM_COEFFICIENTS, self.num_coefficients_used + budget)
        target = sum_color_and_sigma(self.look) + (self.ior - 1.5)
        self.pixels += (target - self.pixels) * np.float32(self.num_coefficients_used / NUM_COEFFICIENTS)
        return make_advance(
            self.all_tiles()[: self.control.num_tiles_per_step],
            exact and self.num_coefficients_used == NUM_COEFFICIENTS,
        )

    def all_tiles(self) -> list[tuple[int, int, int, int]]:
        width, height = self.view.width, self.view.height
        return [
            (x, y, min(TILE, width - x), min(TILE, height - y))
            for y in range(0, height, TILE)
            for x in range(0, width, TILE)
        ]

    def encode_alpha(self, tiles: Sequence[tuple[int, int, int, int]]) -> bytes | None:
        return None

    def encode(self, tiles: Sequence[tuple[int, int, int, int]], form: str) -> bytes:
        assert form == "rgb9e5"
        return b"".join(
            np.full((h, w), round(float(self.pixels[y, x, 0]) * 1000), "<u4").tobytes() for x, y, w, h in tiles
        )

    def image(self) -> np.ndarray:
        return self.pixels

    def inspect(self, x: int, y: int) -> dict[str, Any]:
        return {
            "material": "Paper",
            "position": np.array([1.0, 2.0, 3.0]),
            "normal": np.array([0.0, 1.0, 0.0]),
            "radiance": [float(c) for c in self.pixels[y, x]],
            "bands": np.ones((3, 4)),
            "curve": self.active_pointer,
        }

    def highlight_pixels(self, pointer: str, from_deg: float, to_deg: float) -> np.ndarray:
        return np.full((self.view.height, self.view.width), (to_deg - from_deg) / 90.0, np.float32)


def _open_gate() -> threading.Event:
    gate = threading.Event()
    gate.set()
    return gate


@dataclass
class Control:
    """State that tests set and read."""

    max_step: int = NUM_COEFFICIENTS
    is_refinement: bool = False
    num_looks: int = 0
    num_tiles_per_step: int = 1
    regions: list[tuple[int, int, int, int] | None] = field(default_factory=list)
    controls: list[str | None] = field(default_factory=list)
    solos: list[frozenset[str] | None] = field(default_factory=list)
    num_cancelled: int = 0
    num_opened: int = 0
    freeze_started: threading.Event = field(default_factory=threading.Event)
    freeze_gate: threading.Event = field(default_factory=threading.Event)
    trace_gate: threading.Event = field(default_factory=threading.Event)
    views_over_budget: set[str] = field(default_factory=set)
    stores_in_use: list[set[Path]] = field(default_factory=list)
    render_gate: threading.Event = field(default_factory=_open_gate)
    requested_passes: list[int] = field(default_factory=list)
    requested_reflections: list[bool] = field(default_factory=list)
    frame_cameras: list[tuple[Camera, tuple[int, int]] | None] = field(default_factory=list)
    pass_cameras: list[tuple[Camera, tuple[int, int]]] = field(default_factory=list)

    def open_library(self, cache_bytes: int, floor_bytes: int) -> Library:
        openers_and_renderers = self._open, self._open, self._picture, self._render, self._render_small
        return Library(
            *openers_and_renderers,
            small_renderer,
            self._reference,
            lambda transfer, look: AovTracer.from_look(tiny_scene(), look),
            lambda folder: Viewport.from_scene(load_scene(folder)),
            lambda transfer: ({}, {}),
            lambda: {CacheOwner("linear operator", "0123"): 100},
            lambda: 123,
            lambda stores: self.stores_in_use.append(set(stores)),
        )

    def _open(self, path: Path) -> FakeTransfer:
        attributes = open_store(path).attributes
        width, height = attributes["size"]
        self.num_opened += 1
        return FakeTransfer(attributes["scene"], {name: FakeView(name, width, height) for name in attributes["views"]})

    def _picture(self, transfer: FakeTransfer, view: str) -> FakePicture:
        return FakePicture(transfer, transfer.views[view], self)

    def _render(
        self,
        transfer: FakeTransfer,
        view: str,
        look: Any,
        *,
        progress: Callable[[float], object] = lambda share: None,
        is_canceled: Callable[[], bool] = lambda: False,
        for_display: bool = False,
        camera_and_size: tuple[Camera, tuple[int, int]] | None = None,
        exact: bool = True,
    ) -> np.ndarray:
        """Waits half way while `render_gate` is clear."""
        self.frame_cameras.append(camera_and_size)
        progress(0.5)
        while not self.render_gate.wait(0.01):
            if is_canceled():
                raise CancelledError("stopped")
        progress(1.0)
        width, height = (
            (transfer.views[view].width, transfer.views[view].height) if camera_and_size is None else camera_and_size[1]
        )
        shape = height, width, 3
        return np.full(shape, exact_pixel(look), np.float32)

    def _render_small(self, transfer: FakeTransfer, view: str, look: Any, width: int) -> np.ndarray:
        step = max(1, transfer.views[view].width // width)
        return self._render(transfer, view, look)[::step, ::step]

    def _reference(
        self,
        scene: Path,
        camera: Camera,
        look: Any,
        size: tuple[int, int],
        spp: int,
        progress: Callable[[float], object],
        is_canceled: Callable[[], bool],
        pass_index: int,
        *,
        reflects: bool,
        is_whole: bool,
    ) -> ReferenceImage:
        """Noise of 1/50 around a reference that differs from the frame by a tenth, and by a third with all paths."""
        if not scene.is_dir():
            raise FileNotFoundError(scene)
        self.requested_passes.append(pass_index)
        self.pass_cameras.append((camera, size))
        self.requested_reflections.append(reflects)
        while not self.trace_gate.wait(0.01):
            if is_canceled():
                raise CancelledError("stopped")
        progress(1.0)
        noise = np.random.default_rng(pass_index).standard_normal((size[1], size[0], 3))
        supported = (exact_pixel(look) / 1.1 * (1 + noise / 50)).astype(np.float32)
        all_paths = supported * np.float32(1.1 * 0.75)
        return ReferenceImage(all_paths if is_whole else None, supported, ("What surfaces reflect.",), ())


class InThreadSteps:
    """Run steps in the calling thread with the server's library."""

    def __init__(self, settings: Settings, library: Library, bakes: object = None) -> None:
        self._context = BatchContext(settings.data, library, (settings.import_bytes, settings.import_seconds))

    def run(self, step: Step, report: ProgressCallback, is_needed: IsNeeded) -> Mapping[str, Any]:
        return do_step(self._context, step, report, lambda: not is_needed())

    def num_slots(self) -> int:
        return 1

    def close(self) -> None:
        pass


def sum_color_and_sigma(look: Any) -> float:
    terms = look.materials["Paper"].terms
    return float(terms[0]["color"][0]) + float(terms[1]["params"]["sigma"])


def get_ior(look: Any) -> float:
    return float(look.materials["Paper"].terms[1]["params"]["ior"])


def small_renderer(
    transfer: FakeTransfer, view: str, _width: int, _camera_and_size: object
) -> tuple[tuple[int, int], Callable[[Any], np.ndarray]]:
    """A quarter of the pixels, of the color of a Lambert surface over 0.5: the environment lights them all, and local
    lights the left half."""
    width, height = transfer.views[view].width // 2, transfer.views[view].height // 2

    def render(look: Any) -> np.ndarray:
        image = np.empty((height, width, 3), np.float32)
        image[:] = look.environment.gain
        for light in look.lights.values():
            image[:, : width // 2] += np.asarray(light.gain, np.float32)
        return image * np.array(look.materials["Paper"].terms[0]["color"], np.float32) / np.float32(0.5)

    return (width, height), render


def exact_pixel(look: Any) -> float:
    """Value of each pixel of `FakePicture` when it is exact."""
    return sum_color_and_sigma(look) + get_ior(look) - 1.5
