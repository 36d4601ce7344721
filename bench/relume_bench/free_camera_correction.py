"""free_camera.correction_ratio: error of the image that exact direct light has corrected ÷ that of the moving one.

The scenes of `relume_bench.free_camera_accuracy` in their own materials, from ten cameras around each. Both errors are
against the exact image of that camera: RMSE of linear radiance. The value is the largest ratio of all pictures: a
correction must never take the image further from the exact one. The context has the median, and the ratios of HDR-FLIP.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
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
from relume.scene.model import Camera, Scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.assets import orbited
from relume_bench.figure import Figure
from relume_bench.free_camera_accuracy import FreeCameraSizes, free_camera_scenes
from relume_bench.hdr_flip import hdr_flip

F32 = NDArray[np.float32]

_CACHE_BYTES = 4 << 30
_STEPS = tuple(np.linspace(-2, 2, 10))  # of `orbited`


class _Ratios(NamedTuple):
    """Errors of a corrected image ÷ those of the moving one."""

    rmse: float
    flip: float


def measure(tiny: bool) -> list[Figure]:
    """Bake each scene, stop at each camera."""
    sizes, steps = FreeCameraSizes.choose(tiny), (0.0,) if tiny else _STEPS
    by_scene: dict[str, NDArray[np.float64]] = {}
    for name, scene in free_camera_scenes(sizes):
        by_scene[name] = np.array(list(_measure_scene(scene, sizes, steps)))
        print(f"{name}: {by_scene[name][:, 0].max():.3f}", file=sys.stderr, flush=True)
    rmse, flip = np.concatenate(list(by_scene.values())).T
    context = {
        "pictures": len(rmse), "median": float(np.median(rmse)),
        "flip_median": float(np.median(flip)), "flip_largest": float(flip.max()),
        "by_scene": {name: float(ratios[:, 0].max()) for name, ratios in by_scene.items()},
    }  # fmt: skip
    return [Figure("free_camera.correction_ratio", float(rmse.max()), "ratio", context)]


def _measure_scene(scene: Scene, sizes: FreeCameraSizes, steps: Sequence[float]) -> Iterator[_Ratios]:
    """Ratios of the pictures of a scene. steps: of the cameras"""
    camera = scene.cameras[0]
    recipe = Recipe("probes", (camera.name,), sizes.size, sizes.lights, num_probes=sizes.probes)
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
            yield _stop_at(picture, orbited(scene, step), sizes.size)


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
