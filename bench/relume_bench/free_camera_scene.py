"""A built-in scene baked for a free camera, with drags of the camera, a material or a light."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.primary_visibility import trace_primary as look_around
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.openers import open_bake, open_transfer
from relume.look import Look, complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.examples.catalog import built_in
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.background_jobs import BackgroundJobs
from relume_bench.timing import percentiles

_MOVED = 0.01  # of the distance to the target, per frame
_CACHE_BYTES = 4 << 30
_GOLDEN = 0.618
Change = Callable[[dict[str, Any], float], None]
"""Changes the document of a look, by the fraction of a drag."""

_NUM_WARM_UP = 4  # warm-up drags; their jobs take some tenths of a second each time


class Drag(NamedTuple):
    """Frame times of a drag.

    Attributes:
        seconds: seconds of each frame. lag_s: median age of the look whose indirect light is shown.
    """

    seconds: list[float]
    lag_s: float

    @property
    def median_s(self) -> float:
        """Median frame time."""
        return float(np.median(self.seconds))

    def summarize(self) -> dict[str, float]:
        """Summary for a context: milliseconds, and frames per second over all frames."""
        p50, p95 = percentiles(self.seconds)
        per_second = len(self.seconds) / sum(self.seconds)
        return {"p50_ms": 1e3 * p50, "p95_ms": 1e3 * p95, "per_s": per_second, "lag_ms": 1e3 * self.lag_s}


def run_update_jobs(picture: FreeCameraPicture) -> None:
    """Run the background jobs of a drag now."""
    while (job := picture.next_job()) is not None and not job.is_refinement:
        _run_job(picture, job)


def run_light_jobs(picture: FreeCameraPicture | Picture) -> None:
    """Run the light jobs after a drag: all light is computed, without the refined frame, which is independent of it."""
    while (job := picture.next_job()) is not None and job.kind != "highlights":
        _run_job(picture, job)


def _run_job(picture: FreeCameraPicture | Picture, job: Any) -> None:
    job.apply(job.run(lambda share: None, lambda: False))
    picture.advance(None)


class FreeCameraScene:
    """A built-in scene, baked for a free camera.

    Args:
        name: name of the scene. folder: for its stores. size: size of images. tiny: a trial run.
        num_probes: approximate number; None: 50,000.
    """

    def __init__(
        self, name: str, folder: Path, size: tuple[int, int], tiny: bool, num_probes: int | None = None
    ) -> None:
        requested_probes = num_probes or (2000 if tiny else 50_000)
        self.name, self.folder, self.size, self._scene = name, folder, size, built_in(name)
        self.recipe = Recipe(
            "probes", (self._scene.cameras[0].name,), size, 60 if tiny else 1000, num_probes=requested_probes
        )
        bake_in_process(
            METHODS["probes"], self._scene, replace(self.recipe, num_probes=500), folder / f"{name}-warm.zarr"
        )
        start_time, path = time.perf_counter(), folder / f"{name}.zarr"
        bake_in_process(METHODS["probes"], self._scene, self.recipe, path)
        self.bake_s = time.perf_counter() - start_time
        self.num_bytes = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
        self._num_drags, self._num_warm_up = 0, 1 if tiny else _NUM_WARM_UP
        self.bake = open_bake(path, Cache(_CACHE_BYTES))
        assert isinstance(self.bake, BakedFreeCamera)
        self.free_camera_bake = self.bake
        self.num_probes = self.free_camera_bake.stored_scene.probes.num_points
        triangles = sum(len(mesh.faces) for mesh in self._scene.meshes)
        self.sizes = {"size": f"{size[0]}×{size[1]}", "lights": self.recipe.num_lights, "triangles": triangles}

    @property
    def scene(self) -> Scene:
        """The original scene."""
        return self._scene

    def look(self, change: Callable[[dict[str, Any]], None] = lambda document: None) -> Look:
        """The scene's default look, modified."""
        document = copy.deepcopy(complete({}, self.free_camera_bake.default_look))
        change(document)
        return validate(document, self.free_camera_bake.default_look)

    def picture(self, look: Look, *, is_watched: bool = False) -> FreeCameraPicture:
        """A live image with this look and all its light."""
        picture = FreeCameraPicture(self.free_camera_bake, self.recipe.views[0], is_watched=is_watched)
        picture.set_look(look)
        picture.advance(None)
        run_light_jobs(picture)
        return picture

    def time_camera_moves(
        self, frames: int, change: Callable[[dict[str, Any]], None] = lambda document: None
    ) -> list[float]:
        """Seconds from each camera to its encoded frame, with a modified look. Interactive."""
        picture, camera = self.picture(self.look(change), is_watched=True), self._scene.cameras[0]

        def move(k: int) -> None:
            to_world = camera.to_world.copy()
            to_world[:3, 3] += _MOVED * (k + 1) * to_world[:3, 0]
            picture.set_camera(replace(camera, to_world=to_world), self.size)

        return self._timed(picture, frames, move).seconds

    def edits(
        self,
        frames: int,
        change: Change,
        *,
        is_watched: bool = False,
        on_frame: Callable[[FreeCameraPicture, int], None] = lambda picture, k: None,
    ) -> Drag:
        """Show one look after another, each as soon as the frame of the previous one is encoded.

        Args:
            frames: number. change: change of the look's document, by the fraction of the drag. is_watched: interactive.
            on_frame: other changes to the image in each frame.
        Returns:
            Seconds from each look to its frame. No two drags use the same values, because results of edits are cached.
        """

        def drag() -> Drag:
            self._num_drags += 1
            shift = self._num_drags * _GOLDEN % 1
            looks = [
                self.look(lambda document, k=k: change(document, (k + shift) / (frames + 1)))  # type: ignore[misc]
                for k in range(frames + 1)
            ]
            picture = self.picture(looks[-1], is_watched=is_watched)

            def apply_edit(k: int) -> None:
                picture.set_look(looks[k])
                on_frame(picture, k)

            return self._timed(picture, frames, apply_edit)

        for _ in range(self._num_warm_up):  # in a new process kernels are loaded and memory is touched first
            drag()
        return drag()

    def measure_visible_fraction(self, material: str) -> float:
        """Fraction of the first view's pixels that show a material."""
        face = look_around(
            self.free_camera_bake.stored_scene, self.free_camera_bake.embree, self._scene.cameras[0], self.size
        ).hits.face
        face = face[: self.size[0] * self.size[1]]
        visible_material = self.free_camera_bake.stored_scene.face_material[face[face >= 0]]
        return float(np.sum(visible_material == list(self.free_camera_bake.material_names).index(material)) / len(face))

    def _timed(self, picture: FreeCameraPicture, frames: int, apply_edit: Callable[[int], None]) -> Drag:
        frame_times = []
        with BackgroundJobs(picture) as background:
            for k in range(frames):
                start_time = time.perf_counter()
                apply_edit(k)
                background.request()
                picture.advance(None)
                picture.encode(picture.all_tiles(), "rgb9e5")
                frame_times.append(time.perf_counter() - start_time)
                background.start_next()
        return Drag(frame_times, background.lag_s)

    def exact(self, change: Callable[[dict[str, Any]], None]) -> NDArray[np.float32]:
        """Exact image of a fixed view from the same camera."""
        path = self.folder / f"{self.name}-gather.zarr"
        if not path.exists():
            bake_in_process(METHODS["gather"], self._scene, replace(self.recipe, method="gather"), path)
        transfer = open_transfer(path, Cache(_CACHE_BYTES))
        return render_image(transfer, self.recipe.views[0], self.look(change))[..., :3]

    def inner(self) -> NDArray[np.bool_]:
        """Mask of pixels whose neighbors are in the same face's plane: no object edges. (height, width)"""
        gbuffer = look_around(
            self.free_camera_bake.stored_scene, self.free_camera_bake.embree, self._scene.cameras[0], self.size
        )
        width, height = self.size
        num = width * height  # the first rays go through pixel centers
        face = gbuffer.hits.face[:num].reshape(height, width)
        normal = np.where(face[..., None] >= 0, self.free_camera_bake.stored_scene.face_normal[np.maximum(face, 0)], 0)
        offset = (gbuffer.hits.distance[:num, None] * gbuffer.directions[:num]).reshape(height, width, 3)
        level = np.einsum("hwc,hwc->hw", normal, np.where(face[..., None] >= 0, offset, 0))
        inner = face >= 0
        for axis in (0, 1):
            for step in (1, -1):
                same = np.abs(np.roll(normal, step, axis) - normal).max(axis=2) < 0.2
                inner &= same & (np.abs(np.roll(level, step, axis) - level) < 0.02 * np.abs(level).max())
        return inner


def rotated(document: dict[str, Any], fraction: float) -> None:
    """Rotate the environment by a fraction of a quarter turn."""
    document["environment"]["rotation"] = 90 * fraction
