"""free_camera.correction_ratio: error of the image that exact direct light has corrected ÷ that of the moving one.

Five built-in scenes and ten files of the shared data, 320×240, 50,000 probes, from ten cameras around each. Both errors
are against the exact image of that camera: RMSE of linear radiance. The value is the largest ratio of all pictures: a
correction must never take the image further from the exact one. The context has the median, and the ratios of HDR-FLIP.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.progressive_picture import ProgressivePicture
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.openers import open_bake
from relume.live.opened.static_view import StaticViewBuilder
from relume.look import validate
from relume.methods.registry import METHODS
from relume.scene.examples.catalog import BUILT_IN, built_in
from relume.scene.model import Camera, Scene
from relume.scene_io.import_scene import import_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.asset_files import asset_files
from relume_bench.assets import orbited
from relume_bench.figure import Figure
from relume_bench.hdr_flip import hdr_flip
from relume_bench.scenes import shared_data

F32 = NDArray[np.float32]

_CACHE_BYTES = 4 << 30
_SIZE, _TINY_SIZE = (320, 240), (32, 32)
_NUM_FILES = 10
_STEPS = tuple(np.linspace(-2, 2, 10))  # of `orbited`
_MIN_TRIANGLES = 1000  # of files: plainer ones have nothing that a correction could spoil


class _Ratios(NamedTuple):
    """Errors of a corrected image ÷ those of the moving one."""

    rmse: float
    flip: float


def measure(tiny: bool) -> list[Figure]:
    """Bake each scene, stop at each camera."""
    by_scene = {name: np.array(list(_measure_scene(scene, tiny))) for name, scene in _scenes(tiny)}
    rmse, flip = np.concatenate(list(by_scene.values())).T
    context = {
        "pictures": len(rmse), "median": float(np.median(rmse)),
        "flip_median": float(np.median(flip)), "flip_largest": float(flip.max()),
        "by_scene": {name: float(ratios[:, 0].max()) for name, ratios in by_scene.items()},
    }  # fmt: skip
    return [Figure("free_camera.correction_ratio", float(rmse.max()), "ratio", context)]


def _scenes(tiny: bool) -> Iterator[tuple[str, Scene]]:
    """Built-in scenes, then the first files of the shared data that have enough triangles."""
    for name in ["cornell_box"] if tiny else BUILT_IN:
        yield name, built_in(name)
    if not tiny:
        yield from islice(_large_files(), _NUM_FILES)


def _large_files() -> Iterator[tuple[str, Scene]]:
    for name, path in asset_files(shared_data()):
        scene = import_scene(path, path.stem)
        if sum(len(mesh.faces) for mesh in scene.meshes) >= _MIN_TRIANGLES:
            yield name, scene


def _measure_scene(scene: Scene, tiny: bool) -> Iterator[_Ratios]:
    """Ratios of the pictures of a scene."""
    size, camera = _TINY_SIZE if tiny else _SIZE, scene.cameras[0]
    steps, num_probes = ((0.0,), 2000) if tiny else (_STEPS, 50_000)
    recipe = Recipe("probes", (camera.name,), size, 60 if tiny else 1000, num_probes=num_probes)
    with tempfile.TemporaryDirectory() as folder:
        free_camera_bake = open_bake(
            bake_in_process(METHODS["probes"], scene, recipe, Path(folder) / "probes.zarr"), Cache(_CACHE_BYTES)
        )
        assert isinstance(free_camera_bake, BakedFreeCamera)
        picture = ProgressivePicture(
            FreeCameraPicture(free_camera_bake, camera.name),
            StaticViewBuilder(free_camera_bake.light_transport, scene).make_static_view,
            free_camera_bake.cache,
        )
        picture.set_look(validate({}, free_camera_bake.default_look))
        for step in steps:
            yield _stop_at(picture, orbited(scene, step), size)


def _stop_at(picture: ProgressivePicture, camera: Camera, size: tuple[int, int]) -> _Ratios:
    """Stop at a camera until the image is exact."""
    picture.set_camera(camera, size)
    picture.advance(None)
    moving = corrected = picture.image()
    while (job := picture.next_job()) is not None:
        if job.kind == "direct light":
            moving = picture.image()
        job.apply(job.run(lambda share: None, lambda: False))
        picture.advance(None)
        if job.kind == "direct light":
            corrected = picture.image()
    exact = picture.image()
    errors = [(_rmse(image, exact), _flip(image, exact)) for image in (corrected, moving)]
    return _Ratios(*(error / before for error, before in zip(*errors, strict=True)))


def _rmse(image: F32, exact: F32) -> float:
    return float(np.sqrt(np.mean(np.square(image - exact, dtype=np.float64))))


def _flip(image: F32, exact: F32) -> float:
    return float(hdr_flip(image.astype(np.float64), exact.astype(np.float64)).mean())
