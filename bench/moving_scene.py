"""A built-in scene with views that move, as somebody moves an eye, a material or a light in it."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.beside import Beside
from bench.timing import percentiles
from relume.bake import Recipe
from relume.look import Look, complete, validate
from relume.memory import Memory
from relume.methods.moving_views import MovingViews
from relume.methods.registry import METHODS, open_bake, open_transfer
from relume.moving.fine_job import FineJob
from relume.moving.look_up import look as look_around
from relume.moving.picture import MovingPicture
from relume.picture.picture import Picture
from relume.render.image import render_image
from relume.scene.built_in import built_in
from relume.scene.model import Scene
from relume.store import bake_here

_MOVED = 0.01  # of the distance to the target, each frame
_MEMORY = 4 << 30
_GOLDEN = 0.618
_UNCOUNTED = 4  # drags; what is made beside them takes some tenths of a second each time


class Drag(NamedTuple):
    """Times of its frames.

    Attributes:
        seconds: of each. lag_s: how old the look is whose light between surfaces is shown, the median.
    """

    seconds: list[float]
    lag_s: float

    @property
    def median_s(self) -> float:
        """Of the frames."""
        return float(np.median(self.seconds))

    def said(self) -> dict[str, float]:
        """What a context tells of it: milliseconds, and frames a second of all."""
        p50, p95 = percentiles(self.seconds)
        per_second = len(self.seconds) / sum(self.seconds)
        return {"p50_ms": 1e3 * p50, "p95_ms": 1e3 * p95, "per_s": per_second, "lag_ms": 1e3 * self.lag_s}


def follow(picture: MovingPicture) -> None:
    """What is made beside the frames while a hand moves, made now."""
    while (job := picture.next_job()) is not None and not job.refines:
        _make(picture, job)


def rest(picture: MovingPicture | Picture) -> None:
    """What follows when a hand rests: all its light is found; not the finer frame, which is no matter of light."""
    while (job := picture.next_job()) is not None and not isinstance(job, FineJob):
        _make(picture, job)


def _make(picture: MovingPicture | Picture, job: Any) -> None:
    picture.install(job, job.make(lambda share: None, lambda: False))
    picture.advance(None)


class MovingScene:
    """A built-in scene, baked with views that move.

    Args:
        name: of the scene. folder: for its stores. size: of pictures. tiny: whether it is a trial.
        num_points: about how many; None: 50,000.
    """

    def __init__(
        self, name: str, folder: Path, size: tuple[int, int], tiny: bool, num_points: int | None = None
    ) -> None:
        asked = num_points or (2000 if tiny else 50_000)
        self.name, self.folder, self.size, self._scene = name, folder, size, built_in(name)
        self.recipe = Recipe("surface", (self._scene.cameras[0].name,), size, 60 if tiny else 1000, num_points=asked)
        bake_here(METHODS["surface"], self._scene, replace(self.recipe, num_points=500), folder / f"{name}-warm.zarr")
        began, path = time.perf_counter(), folder / f"{name}.zarr"
        bake_here(METHODS["surface"], self._scene, self.recipe, path)
        self.bake_s = time.perf_counter() - began
        self.num_bytes = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
        self._num_drags, self._num_uncounted = 0, 1 if tiny else _UNCOUNTED
        self.opened = open_bake(path, Memory(_MEMORY))
        assert isinstance(self.opened, MovingViews)
        self.moving = self.opened
        self.num_points = self.moving.surface.points.num_points
        triangles = sum(len(mesh.faces) for mesh in self._scene.meshes)
        self.sizes = {"size": f"{size[0]}×{size[1]}", "lights": self.recipe.num_lights, "triangles": triangles}

    @property
    def scene(self) -> Scene:
        """As it was made."""
        return self._scene

    def look(self, change: Callable[[dict[str, Any]], None] = lambda document: None) -> Look:
        """The scene's own, changed."""
        document = copy.deepcopy(complete({}, self.moving.default_look))
        change(document)
        return validate(document, self.moving.default_look)

    def picture(self, look: Look, *, is_watched: bool = False) -> MovingPicture:
        """A picture with that look, all its light there."""
        picture = MovingPicture(self.moving, self.recipe.views[0], is_watched=is_watched)
        picture.set_look(look)
        picture.advance(None)
        rest(picture)
        return picture

    def eye_s(self, frames: int, change: Callable[[dict[str, Any]], None] = lambda document: None) -> list[float]:
        """Seconds from an eye to its encoded frame, each once; of a changed look. Somebody watches."""
        picture, camera = self.picture(self.look(change), is_watched=True), self._scene.cameras[0]

        def move(k: int) -> None:
            to_world = camera.to_world.copy()
            to_world[:3, 3] += _MOVED * (k + 1) * to_world[:3, 0]
            picture.set_eye(replace(camera, to_world=to_world), self.size)

        return self._timed(picture, frames, move).seconds

    def edits(
        self,
        frames: int,
        change: Callable[[dict[str, Any], float], None],
        *,
        is_watched: bool = False,
        beside: Callable[[MovingPicture, int], None] = lambda picture, k: None,
    ) -> Drag:
        """A look after the other, each as soon as the frame of the one before is encoded.

        Args:
            frames: how many. change: of the look's document, by the share of the way. is_watched: somebody waits.
            beside: what else happens to the picture in each frame.
        Returns:
            Seconds from each look to its frame. No two drags come to the same values: what an edit is projected to is
            found in each.
        """

        def drag() -> Drag:
            self._num_drags += 1
            shift = self._num_drags * _GOLDEN % 1
            looks = [
                self.look(lambda document, k=k: change(document, (k + shift) / (frames + 1)))  # type: ignore[misc]
                for k in range(frames + 1)
            ]
            picture = self.picture(looks[-1], is_watched=is_watched)

            def begin(k: int) -> None:
                picture.set_look(looks[k])
                beside(picture, k)

            return self._timed(picture, frames, begin)

        for _ in range(self._num_uncounted):  # of a process just begun, kernels are loaded and memory is touched first
            drag()
        return drag()

    def share_of(self, material: str) -> float:
        """Share of the first view's pixels that show a material."""
        face = look_around(self.moving.surface, self.moving.embree, self._scene.cameras[0], self.size).hits.face
        face = face[: self.size[0] * self.size[1]]
        seen = self.moving.surface.face_material[face[face >= 0]]
        return float(np.sum(seen == list(self.moving.material_names).index(material)) / len(face))

    def _timed(self, picture: MovingPicture, frames: int, begin: Callable[[int], None]) -> Drag:
        found = []
        with Beside(picture) as beside:
            for k in range(frames):
                began = time.perf_counter()
                begin(k)
                beside.want()
                picture.advance(None)
                picture.encode(picture.all_tiles(), "rgb9e5")
                found.append(time.perf_counter() - began)
                beside.go_on()
        return Drag(found, beside.lag_s)

    def exact(self, change: Callable[[dict[str, Any]], None]) -> NDArray[np.float32]:
        """The picture of a fixed view from the same place."""
        path = self.folder / f"{self.name}-gather.zarr"
        if not path.exists():
            bake_here(METHODS["gather"], self._scene, replace(self.recipe, method="gather"), path)
        transfer = open_transfer(path, Memory(_MEMORY))
        return render_image(transfer, self.recipe.views[0], self.look(change))[..., :3]

    def inner(self) -> NDArray[np.bool_]:
        """Pixels whose neighbours see the same face's plane: no edge of an object. (height, width)"""
        seen = look_around(self.moving.surface, self.moving.embree, self._scene.cameras[0], self.size)
        width, height = self.size
        num = width * height  # the first rays go through the middles of pixels
        face = seen.hits.face[:num].reshape(height, width)
        normal = np.where(face[..., None] >= 0, self.moving.surface.face_normal[np.maximum(face, 0)], 0)
        place = (seen.hits.distance[:num, None] * seen.directions[:num]).reshape(height, width, 3)
        level = np.einsum("hwc,hwc->hw", normal, np.where(face[..., None] >= 0, place, 0))
        inner = face >= 0
        for axis in (0, 1):
            for step in (1, -1):
                same = np.abs(np.roll(normal, step, axis) - normal).max(axis=2) < 0.2
                inner &= same & (np.abs(np.roll(level, step, axis) - level) < 0.02 * np.abs(level).max())
        return inner


def rotated(document: dict[str, Any], share: float) -> None:
    """Turn the environment by a share of a quarter turn."""
    document["environment"]["rotation"] = 90 * share
