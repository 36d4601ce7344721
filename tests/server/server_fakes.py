"""Stand-ins for the library: a picture whose every pixel is known, a bake method that computes nothing."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from relume.bake import ArraySpec, Plan, Recipe, StoreReader, Task, Written
from relume.environments.model import Environment
from relume.errors import CancelledError, EditNotSupportedError, MemoryBudgetError
from relume.look import default_look
from relume.memory import Holder
from relume.picture.transfer import Axis, Eyes
from relume.reference import Truth
from relume.render.finder import Finder
from relume.scene.archive import load_scene, make_scene
from relume.scene.model import Camera, Material, Mesh, Scene
from relume.store import open_store
from server.apart.step import IsWanted, Step, Tell
from server.apart.steps import do_step
from server.apart.workshop import Workshop
from server.files.importing import ImportRequest, _written
from server.library.ports import Library
from server.settings import Settings

THETA_H, THETA_D = (f"/materials/Paper/terms/1/curves/{name}" for name in ("theta_h", "theta_d"))
TILE = 64
SIZE = (160, 96)
NUM_COEFFICIENTS = 16


def tiny_scene(name: str = "triangle") -> Scene:
    """One triangle of one material with a diffuse and a glossy term, seen from two views."""
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


def made(request: ImportRequest) -> str:
    """What the process of an import does, without one: it makes the tiny scene, whatever the file is."""
    return _written(request, tiny_scene())


@dataclass(frozen=True)
class FakeMethod:
    """One task per bake; it waits for `gate` where there is one."""

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

    def compute(self, scene: Scene, recipe: Recipe, task: Task, store: StoreReader) -> Written:
        if self.gate is not None:
            self.gate.wait(30)
        return Written({"values": np.arange(4, dtype=np.float32)}, 10, 0.0)


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
    """What `open_transfer` gives."""

    scene_id: str
    views: dict[str, FakeView]
    method: str = "direct"
    default_look: dict[str, Any] = field(default_factory=lambda: default_look(tiny_scene().materials))
    material_names: list[str] = field(default_factory=lambda: ["Paper"])

    eyes: Eyes = Eyes.BAKED

    @property
    def axes(self) -> frozenset[Axis]:
        return frozenset([Axis.CURVE, *([Axis.BOUNCES] if self.method == "gather" else [])])

    def radiance_of(self, name: str | None) -> np.ndarray:
        return np.ones((4, 8, 3), np.float32)


@dataclass(frozen=True)
class FakeJob:
    """One curve; made when `control.may_freeze` says so."""

    control: "Control"
    key: str
    state: str = "freezing"
    refines: bool = False
    goes_on: bool = False

    @property
    def what(self) -> str:
        return f"Paper, {self.key.rsplit('/', 1)[-1]}"

    def make(self, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> str:
        self.control.freezing.set()
        progress(0.5)
        while not self.control.may_freeze.wait(0.01):
            if cancelled():
                self.control.num_cancelled += 1
                raise CancelledError("stopped")
        return self.key


def advance_of(tiles: list[Any], exact: bool) -> SimpleNamespace:
    """What a step of a whole picture says."""
    fidelity = "exact" if exact else "approximate"
    shown = {"exact": exact, "fidelity": fidelity, "complete": True, "was_off": None}
    return SimpleNamespace(tiles=tiles, changed=bool(tiles), **shown)


@dataclass
class FakePicture:
    """Radiance = lambert colour + sigma, everywhere; reached in steps. ior needs θd, which is not frozen at first."""

    transfer: FakeTransfer
    view: FakeView
    control: "Control"
    look: Any = None
    spent: int = 0
    frozen: set[str] = field(default_factory=lambda: {THETA_H})
    wanted: str = THETA_H
    ior: float = 1.5

    def __post_init__(self) -> None:
        self.pixels = np.zeros((self.view.height, self.view.width, 3), np.float32)

    def set_look(self, look: Any, *, hand: str | None, solo: frozenset[str] | None) -> None:
        if look.environment.rotation != 0.0:
            raise EditNotSupportedError("direct", "the environment's rotation")
        if self.look is None or colour_and_sigma(look) != colour_and_sigma(self.look):
            self.spent = 0
        self.look = look
        self.control.num_looks += 1
        self.control.hands.append(hand)
        self.control.solos.append(solo)

    def look_at(self, region: tuple[int, int, int, int] | None) -> None:
        self.control.regions.append(region)

    def check(self, look: Any) -> None:
        if self.view.name in self.control.short_of_memory and ior_of(look) != self.ior:
            raise MemoryBudgetError("the curve", 2, 1, "close it")

    def touch(self, pointer: str) -> None:
        if self.view.name in self.control.short_of_memory:
            raise MemoryBudgetError("the curve", 2, 1, "close it")
        self.wanted = pointer

    def next_job(self) -> FakeJob | None:
        lacking = [THETA_D] if self._lacks_theta_d() else []
        needed = [curve for curve in (*lacking, self.wanted) if curve not in self.frozen]
        return FakeJob(self.control, needed[0], refines=self.control.refines) if needed else None

    def install(self, need: FakeJob, made: str) -> None:
        self.frozen.add(made)

    def _lacks_theta_d(self) -> bool:
        return self.look is not None and ior_of(self.look) != self.ior

    def advance(self, max_coefficients: int | None) -> Any:
        if self._lacks_theta_d() and THETA_D in self.frozen:
            self.ior, self.spent = ior_of(self.look), 0
        exact = not self._lacks_theta_d()
        if self.spent >= NUM_COEFFICIENTS:
            return advance_of([], exact)
        budget = NUM_COEFFICIENTS if max_coefficients is None else min(max_coefficients, self.control.max_step)
        self.spent = min(NUM_COEFFICIENTS, self.spent + budget)
        target = colour_and_sigma(self.look) + (self.ior - 1.5)
        self.pixels += (target - self.pixels) * np.float32(self.spent / NUM_COEFFICIENTS)
        return advance_of(self.all_tiles()[: self.control.tiles_a_step], exact and self.spent == NUM_COEFFICIENTS)

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

    def probe(self, x: int, y: int) -> dict[str, Any]:
        return {
            "material": "Paper",
            "position": np.array([1.0, 2.0, 3.0]),
            "normal": np.array([0.0, 1.0, 0.0]),
            "radiance": [float(c) for c in self.pixels[y, x]],
            "bands": np.ones((3, 4)),
            "curve": self.wanted,
        }

    def brush(self, pointer: str, from_deg: float, to_deg: float) -> np.ndarray:
        return np.full((self.view.height, self.view.width), (to_deg - from_deg) / 90.0, np.float32)


def _open_gate() -> threading.Event:
    gate = threading.Event()
    gate.set()
    return gate


@dataclass
class Control:
    """What tests set and see."""

    max_step: int = NUM_COEFFICIENTS
    refines: bool = False
    num_looks: int = 0
    tiles_a_step: int = 1
    regions: list[tuple[int, int, int, int] | None] = field(default_factory=list)
    hands: list[str | None] = field(default_factory=list)
    solos: list[frozenset[str] | None] = field(default_factory=list)
    num_cancelled: int = 0
    num_opened: int = 0
    freezing: threading.Event = field(default_factory=threading.Event)
    may_freeze: threading.Event = field(default_factory=threading.Event)
    may_trace: threading.Event = field(default_factory=threading.Event)
    short_of_memory: set[str] = field(default_factory=set)
    stores_kept: list[set[Path]] = field(default_factory=list)
    render_gate: threading.Event = field(default_factory=_open_gate)
    passes_asked: list[int] = field(default_factory=list)
    reflections_asked: list[bool] = field(default_factory=list)
    frames_from: list[tuple[Camera, tuple[int, int]] | None] = field(default_factory=list)
    passes_from: list[tuple[Camera, tuple[int, int]]] = field(default_factory=list)

    def open_library(self, cache_bytes: int, floor_bytes: int) -> Library:
        paint = self._open, self._open, self._picture, self._render, self._render_small, self._reference
        return Library(
            *paint,
            lambda folder: Finder.of(load_scene(folder)),
            lambda transfer: ({}, {}),
            lambda: {Holder("frozen", "0123"): 100},
            lambda: 123,
            lambda stores: self.stores_kept.append(set(stores)),
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
        cancelled: Callable[[], bool] = lambda: False,
        for_display: bool = False,
        eye: tuple[Camera, tuple[int, int]] | None = None,
        exact: bool = True,
    ) -> np.ndarray:
        """It waits half way while `render_gate` is clear."""
        self.frames_from.append(eye)
        progress(0.5)
        while not self.render_gate.wait(0.01):
            if cancelled():
                raise CancelledError("stopped")
        progress(1.0)
        width, height = (transfer.views[view].width, transfer.views[view].height) if eye is None else eye[1]
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
        cancelled: Callable[[], bool],
        pass_index: int,
        *,
        reflects: bool,
        is_whole: bool,
    ) -> Truth:
        """Noise of a fiftieth around a truth that the frame misses by a tenth, and by a third by all paths."""
        if not scene.is_dir():
            raise FileNotFoundError(scene)
        self.passes_asked.append(pass_index)
        self.passes_from.append((camera, size))
        self.reflections_asked.append(reflects)
        while not self.may_trace.wait(0.01):
            if cancelled():
                raise CancelledError("stopped")
        progress(1.0)
        noise = np.random.default_rng(pass_index).standard_normal((size[1], size[0], 3))
        followed = (exact_pixel(look) / 1.1 * (1 + noise / 50)).astype(np.float32)
        whole = followed * np.float32(1.1 * 0.75)
        return Truth(whole if is_whole else None, followed, ("What surfaces reflect.",), ())


class BatchesHere:
    """Does steps in the thread that asks, with the library that the server has."""

    def __init__(self, settings: Settings, library: Library) -> None:
        self._shop = Workshop(settings.data, library)

    def run(self, step: Step, tell: Tell, is_wanted: IsWanted) -> Mapping[str, Any]:
        return do_step(self._shop, step, tell, lambda: not is_wanted())

    def resident_bytes(self) -> int:
        return 0

    def let_go(self) -> None:
        pass

    def close(self) -> None:
        pass


def colour_and_sigma(look: Any) -> float:
    terms = look.materials["Paper"].terms
    return float(terms[0]["color"][0]) + float(terms[1]["params"]["sigma"])


def ior_of(look: Any) -> float:
    return float(look.materials["Paper"].terms[1]["params"]["ior"])


def exact_pixel(look: Any) -> float:
    """What `FakePicture` shows everywhere when it is exact."""
    return colour_and_sigma(look) + ior_of(look) - 1.5
