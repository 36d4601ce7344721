"""surface.*: what somebody waits who moves the eye, a material or a light of a view that moves.

Scenes: the Cornell box under the sky at 400×400, and the still life at 640×480, which has twice as many triangles as
points. Times are from a message's content to the encoded bytes. `surface.view_fps`: the eye moves sideways, the look
stays. `surface.brdf_ms`: the exponent of a highlight moves, the eye and the lights stay; what surfaces reflect onto
each other follows at rest. `surface.light_ms`: the environment turns, with all bounces, and is followed roughly;
`all_points_ms` is what all of it takes, at rest. `surface.against_fixed_…` is the moving view against the picture that
replaces it, of a `gather` bake from the same place, pixels at edges of objects left out, which one side has
antialiased; both spread evenly what highlights send to other surfaces. `surface.points_rmse`, without interpolation:
irradiance of points straight from the sky against every texel of it traced.
"""

from __future__ import annotations

import copy
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.figure import Figure
from bench.timing import percentiles
from relume.bake import Recipe
from relume.environments.equirect import texel_directions, texel_solid_angles
from relume.look import Look, complete, validate
from relume.memory import Memory
from relume.methods.moving_views import MovingViews
from relume.methods.registry import METHODS, open_bake, open_transfer
from relume.moving.arriving import arriving
from relume.moving.look_up import look as look_around
from relume.moving.picture import MovingPicture
from relume.parallel import num_threads
from relume.picture.light import light_of
from relume.render.image import render_image
from relume.scene.built_in import built_in
from relume.scene.model import Scene
from relume.store import bake_here
from relume.trace.visibility import trace_visibility

_MOVED = 0.01  # of the distance to the target, each frame
_MEMORY = 4 << 30


def measure(tiny: bool) -> list[Figure]:
    """Bake both scenes, move, edit, compare."""
    with tempfile.TemporaryDirectory() as folder:
        box = _Scene("cornell_box", Path(folder), (60, 60) if tiny else (400, 400), tiny)
        still = _Scene("interior" if tiny else "still_life", Path(folder), (64, 48) if tiny else (640, 480), tiny)
        frames = 3 if tiny else 60
        eye = {one.name: one.eye_s(frames) for one in (box, still)}
        context = {"threads": num_threads(), "points": {one.name: one.num_points for one in (box, still)}}
        brdf, light = (
            box.edits_s(frames, _exponent, is_watched=True),
            box.edits_s(max(2, frames // 6), _rotation, is_watched=True),
        )
        exactly = {"all_points_ms": 1e3 * percentiles(box.edits_s(3, _rotation))[0]}
        return [
            Figure("surface.bake_s", still.bake_s, "s", {**context, "cornell_box": box.bake_s, **still.sizes}),
            Figure("surface.bytes_per_point", still.num_bytes / still.num_points, "bytes", context),
            Figure(
                "surface.view_fps",
                1 / float(np.median(eye[still.name])),
                "frames/s",
                {**context, "size": "640×480", "cornell_box_400": 1 / float(np.median(eye["cornell_box"]))},
            ),
            Figure(
                "surface.brdf_ms", 1e3 * percentiles(brdf)[0], "ms", {**context, "size": "400×400", "bounces": "all"}
            ),
            Figure(
                "surface.light_ms",
                1e3 * percentiles(light)[0],
                "ms",
                {**context, **exactly, "size": "400×400", "bounces": "all"},
            ),
            *(_error(box if "diffuse" in name else still, name, terms) for name, terms in _MATERIALS.items()),
            Figure("surface.points_rmse", 100 * box.points_rmse(4 if tiny else 400), "%", context),
        ]


_MATERIALS: dict[str, list[dict[str, Any]]] = {
    "surface.against_fixed_diffuse": [{"model": "lambert", "color": [0.7, 0.7, 0.7], "texture": None}],
    "surface.against_fixed_glossy_0.5": [{"model": "ggx", "params": {"roughness": 0.5, "f0": 0.9}, "texture": None}],
    "surface.against_fixed_glossy_0.3": [{"model": "ggx", "params": {"roughness": 0.3, "f0": 0.9}, "texture": None}],
}
_GLOSSY = {"model": "blinn_phong", "color": [0.5, 0.5, 0.5], "texture": None, "params": {"exponent": 20.0}}


class _Scene:
    """A built-in scene, baked with views that move."""

    def __init__(self, name: str, folder: Path, size: tuple[int, int], tiny: bool) -> None:
        self.name, self.folder, self.size, self._scene = name, folder, size, built_in(name)
        self.recipe = Recipe(
            "surface", (self._scene.cameras[0].name,), size, 60 if tiny else 1000, num_points=2000 if tiny else 50_000
        )
        bake_here(METHODS["surface"], self._scene, replace(self.recipe, num_points=500), folder / f"{name}-warm.zarr")
        began, path = time.perf_counter(), folder / f"{name}.zarr"
        bake_here(METHODS["surface"], self._scene, self.recipe, path)
        self.bake_s = time.perf_counter() - began
        self.num_bytes = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
        self.opened = open_bake(path, Memory(_MEMORY))
        assert isinstance(self.opened, MovingViews)
        self.moving = self.opened
        self.num_points = self.moving.surface.points.num_points
        triangles = sum(len(mesh.faces) for mesh in self._scene.meshes)
        self.sizes = {"size": f"{size[0]}×{size[1]}", "lights": self.recipe.num_lights, "triangles": triangles}

    @property
    def scene(self) -> Scene:
        return self._scene

    def look(self, change: Callable[[dict[str, Any]], None] = lambda document: None) -> Look:
        document = copy.deepcopy(complete({}, self.moving.default_look))
        change(document)
        return validate(document, self.moving.default_look)

    def picture(self, look: Look, *, is_watched: bool = False) -> MovingPicture:
        picture = MovingPicture(self.moving, self.recipe.views[0], is_watched=is_watched)
        picture.set_look(look)
        picture.advance(None)
        if (job := picture.next_job()) is not None:
            picture.install(job, job.make(lambda share: None, lambda: False))
            picture.advance(None)
        return picture

    def eye_s(self, frames: int) -> list[float]:
        """Seconds from an eye to its encoded frame, each once."""
        picture, camera = self.picture(self.look()), self._scene.cameras[0]

        def move(k: int) -> None:
            to_world = camera.to_world.copy()
            to_world[:3, 3] += _MOVED * (k + 1) * to_world[:3, 0]
            picture.set_eye(replace(camera, to_world=to_world), self.size)

        return self._timed(picture, frames, move)

    def edits_s(
        self, frames: int, change: Callable[[dict[str, Any], float], None], *, is_watched: bool = False
    ) -> list[float]:
        """Seconds from a look to its encoded frame, each once."""
        looks = [
            self.look(lambda document, k=k: change(document, k / frames))  # type: ignore[misc]
            for k in range(frames + 1)
        ]
        picture = self.picture(looks[-1], is_watched=is_watched)
        return self._timed(picture, frames, lambda k: picture.set_look(looks[k]))

    def _timed(self, picture: MovingPicture, frames: int, begin: Callable[[int], None]) -> list[float]:
        found = []
        for k in range(frames):
            began = time.perf_counter()
            begin(k)
            picture.advance(None)
            picture.encode(picture.all_tiles(), "rgb9e5")
            found.append(time.perf_counter() - began)
        return found

    def points_rmse(self, num: int) -> float:
        """Irradiance of some points straight from the sky, against every texel of the map traced."""
        points = self.moving.surface.points
        chosen = np.linspace(0, points.num_points - 1, num).astype(np.int64)
        some = points.rows(chosen)
        radiance = np.asarray(self._scene.environment.radiance, np.float64)
        height, width, _ = radiance.shape
        directions = texel_directions(height, width).reshape(-1, 3).astype(np.float32)
        light = (radiance * texel_solid_angles(height, width)[:, None, None]).reshape(-1, 3)
        seen = trace_visibility(self.moving.embree, some.position, some.normal, directions).visible
        truth = np.empty((num, 3))
        for k in range(num):
            free = np.unpackbits(seen[k], count=len(directions), bitorder="little")
            cosine = np.maximum(directions @ some.normal[k], 0).astype(np.float64)
            truth[k] = (free * cosine) @ light

        def direct(document: dict[str, Any]) -> None:
            document["transport"]["show"] = "direct"

        shown = light_of(self.look(direct), self.moving.material_names, has_bounces=True)
        found = np.sqrt(np.pi) * arriving(self.moving, shown, self.moving.vectors).total[chosen, :, 0].astype(
            np.float64
        )
        return float(np.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2)))

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


def _exponent(document: dict[str, Any], share: float) -> None:
    white = {"model": "lambert", "color": [0.3, 0.3, 0.3], "texture": None}
    floor = next(iter(document["materials"].values()))
    floor["terms"] = [white, {**_GLOSSY, "params": {"exponent": 5.0 + 30 * share}}]


def _rotation(document: dict[str, Any], share: float) -> None:
    document["environment"]["rotation"] = 90 * share


def _error(of: _Scene, name: str, terms: list[dict[str, Any]]) -> Figure:
    """Of a scene whose surfaces are all of one material."""

    def change(document: dict[str, Any]) -> None:
        for material in document["materials"].values():
            material["terms"] = copy.deepcopy(terms)

    found, exact, inner = of.picture(of.look(change)).image(), of.exact(change), of.inner()
    error = float(np.sqrt(np.mean((found[inner] - exact[inner]) ** 2) / np.mean(exact[inner] ** 2)))
    bias = float(found[inner].mean() / exact[inner].mean() - 1)
    everywhere = float(np.sqrt(np.mean((found - exact) ** 2) / np.mean(exact**2)))
    context = {"scene": of.name, "bias": bias, "with_edges": everywhere, "pixels": int(inner.sum()), **of.sizes}
    return Figure(name, 100 * error, "%", context)
