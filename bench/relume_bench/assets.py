"""assets.*: files by others, imported, baked with indirect light and rendered, against Mitsuba with its own reader.

Each file of `relume_bench.asset_files`, from two cameras, in two environments. The peer's scene is made from the file's
bytes by `relume_bench.gltf_plain` or `relume_bench.mesh_plain` and `relume_bench.plain_materials`, with the BRDF of the
specification (`relume_bench.peer_mitsuba_gltf`) and the peer's own dielectrics; neither importer nor terms are shared.

Errors are over pixels on surfaces, and a file's are the means of its four pictures: relative RMSE with Mitsuba's noise
removed (its upper bound if it is below the noise), bias, HDR-FLIP, and the 99th percentile of the difference of display
values. `flip_with_noise` is HDR-FLIP against the mean of Mitsuba's passes; see `relume_bench.hdr_flip.without_noise`.

Images are stored in the user's cache, in `assets` and `peers`, for each version of relume and of the peer's scripts: a
run that was stopped goes on where it was. A file that fails is listed with its error: docs/accuracy-assets.md.
"""

from __future__ import annotations

import tempfile
import time
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import platformdirs
from numpy.typing import NDArray

import relume
from relume.assets.environments.environment import Environment
from relume.assets.environments.read_environment import read_environment
from relume.core.cache import Cache
from relume.core.digest import digest
from relume.image_io.tone_mapping import tone_map
from relume.live.opened.openers import open_transfer
from relume.look import validate
from relume.output.render_image import render_image
from relume.scene.custom_camera import with_cameras
from relume.scene.model import Camera, Scene
from relume.scene_io.import_scene import import_scene
from relume.store.bake_protocol import Recipe
from relume_bench.asset_files import asset_files
from relume_bench.figure import Figure, skipped
from relume_bench.gather import bake
from relume_bench.hdr_flip import hdr_flip, without_noise
from relume_bench.mitsuba import averaged, cache_passes, map_for_mitsuba, missing, run_peer
from relume_bench.plain_job import make_job, read_file
from relume_bench.scenes import shared_data
from relume_bench.standard_error import compare_pixels

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_NAMES = ("assets.rmse_median", "assets.rmse_p90", "assets.flip_median", "assets.flip_p90")
_UNIT, _FLIP_UNIT = "relative RMSE", "HDR-FLIP"
ENVIRONMENTS = ("polyhaven_studio_small_03_1k", "polyhaven_venice_sunset_1k")
SECOND = "second"
# degrees from the first camera to the second, around the vertical through what it looks at; less within a room, whose
# walls are near
_ORBIT, _ORBIT_INSIDE = 40.0, 10.0
_NOISE, _ROUNDS = 0.02, 8  # relative noise at which Mitsuba stops, and the most times that it renders its paths
_FINER = 2  # pixels that are averaged along each side


FILE_VALUES = ("rmse", "bias", "flip", "flip_with_noise", "p99")  # of each picture; a file has their means


class AssetSizes(NamedTuple):
    """Width and height of images; lights of bakes; independent images of Mitsuba, and paths a pixel of each."""

    size: tuple[int, int]
    lights: int
    passes: int
    spp: int

    @classmethod
    def choose(cls, tiny: bool) -> AssetSizes:
        """The measured sizes, or with `tiny` those of a trial run."""
        return cls((32, 24), 60, 2, 2) if tiny else cls((192, 144), 1000, 4, 64)


def measure(tiny: bool) -> list[Figure]:
    """Two bakes and four pictures of each file."""
    if (why := missing()) is not None:
        return [*skipped(_NAMES[:2], _UNIT, why), *skipped(_NAMES[2:], _FLIP_UNIT, why)]
    files = list(islice(asset_files(shared_data()), 1 if tiny else None))
    if not files:
        why = "the shared data is not there; bench/relume_bench/scenes.py describes its location"
        return [*skipped(_NAMES[:2], _UNIT, why), *skipped(_NAMES[2:], _FLIP_UNIT, why)]
    return summarize({name: compared(path, tiny) for name, path in files}, tiny)


def summarize(results: Mapping[str, Mapping[str, Any]], tiny: bool) -> list[Figure]:
    """The figures of the results of files by name. Raises ValueError if all failed."""
    sizes, measured = AssetSizes.choose(tiny), [result for result in results.values() if "error" not in result]
    if not measured:
        raise ValueError(f"no file could be measured: {next(iter(results.values()))['error']}")
    context = {
        "files": len(measured), "files_that_failed": len(results) - len(measured),
        "size": list(sizes.size), "lights": sizes.lights,
        "least_spp": sizes.passes * sizes.spp, "most_spp": _ROUNDS * sizes.passes * sizes.spp,
    }  # fmt: skip
    figures = []
    for key, unit in (("rmse", _UNIT), ("flip", _FLIP_UNIT)):
        values = [result[key] for result in measured]
        middle, high = (float(np.percentile(values, share)) for share in (50, 90))
        figures += [
            Figure(f"assets.{key}_median", middle, unit, context),
            Figure(f"assets.{key}_p90", high, unit, context),
        ]
    by_file = {
        name: {key: value for key, value in result.items() if key != "pictures"} for name, result in results.items()
    }
    return [replace(figures[0], context={**context, "by_file": by_file}), *figures[1:]]


class Pictures(NamedTuple):
    """One shot: our image, (h, w, 3); the mask of its pixels on surfaces; Mitsuba's images, (passes, h, w, 3)."""

    image: F64
    is_surface: NDArray[np.bool_]
    passes: F32


def compared(path: Path, tiny: bool) -> dict[str, Any]:
    """Errors of a file: means of its pictures, and those of each of the "pictures"; "error" if it failed.

    Args:
        path: the file. tiny: a trial run.
    """
    start_time = time.perf_counter()
    try:
        errors = {name: _errors(pictures) for name, pictures in render_file(path, tiny).items()}
    except Exception as error:  # the other files must still be measured
        traceback.print_exc()
        return {"error": f"{type(error).__name__}: {error}"[:300]}
    means = {key: float(np.mean([picture[key] for picture in errors.values()])) for key in FILE_VALUES}
    return {**means, "pictures": errors, "seconds": round(time.perf_counter() - start_time, 1)}


def render_file(path: Path, tiny: bool) -> dict[str, Pictures]:
    """The four pictures of a file by environment and camera. path, tiny: as for `compared`"""
    scene, sizes = import_scene(path, path.stem), AssetSizes.choose(tiny)
    scene = with_cameras(scene, [orbited(scene)])
    views = (scene.cameras[0].name, SECOND)
    shots = [(environment, view) for environment in ENVIRONMENTS for view in views]
    ours = [_render_relume(path, scene, environment, views, sizes) for environment in ENVIRONMENTS]
    images, masks = (np.concatenate([stored[key] for stored in ours]) for key in ("images", "is_surface"))
    theirs = _render_mitsuba(path, scene, shots, sizes)
    return {", ".join(shot): Pictures(images[k], masks[k], theirs[k]) for k, shot in enumerate(shots)}


def orbited(scene: Scene, steps: float = 1.0) -> Camera:
    """The second camera: the first, moved around the vertical through the depth of the scene's middle.

    Args:
        scene: with a camera. steps: multiples of the angle.
    """
    camera, points = scene.cameras[0], np.concatenate([mesh.positions for mesh in scene.meshes])
    low, high = points.min(axis=0), points.max(axis=0)
    center, position, backward = (low + high) / 2, camera.to_world[:3, 3], camera.to_world[:3, 2]
    is_inside = bool(((position > low) & (position < high)).all())
    pivot = position - backward * max(0.0, float((position - center) @ backward))
    angle = steps * np.radians(_ORBIT_INSIDE if is_inside else _ORBIT)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    to_world = camera.to_world.copy()
    to_world[:3, :3], to_world[:3, 3] = turn @ camera.to_world[:3, :3], pivot + turn @ (position - pivot)
    return Camera(SECOND, to_world, camera.yfov)


@cache
def environment_of(name: str) -> Environment:
    """One of `ENVIRONMENTS`."""
    return read_environment(shared_data() / "envmaps" / f"{name}.hdr", name)


def _render_relume(
    path: Path, scene: Scene, environment: str, views: Sequence[str], sizes: AssetSizes
) -> Mapping[str, NDArray[Any]]:
    """Images of the views, and masks "is_surface"; stored for each version of relume."""
    key = digest((scene.id, environment, [camera.to_world.tolist() for camera in scene.cameras], sizes, _sources()))
    stored = platformdirs.user_cache_path("relume") / "assets" / f"{path.stem}-{key}.npz"
    if not stored.is_file():
        stored.parent.mkdir(parents=True, exist_ok=True)
        lit = with_cameras(import_scene(path, path.stem, environment_of(environment)), [scene.cameras[-1]])
        width, height = sizes.size
        recipe = Recipe("gather", tuple(views), (_FINER * width, _FINER * height), sizes.lights)
        with tempfile.TemporaryDirectory() as folder:
            transfer = open_transfer(bake(lit, recipe, Path(folder) / "gather.zarr").path, Cache(4 << 30))
            look, images, masks = validate({}, transfer.default_look), [], []
            for view in views:
                images.append(averaged(render_image(transfer, view, look), _FINER))
                opened = transfer.views[view]
                covered = np.bincount(
                    opened.pixel[: opened.num_surface_samples], minlength=opened.width * opened.height
                )
                masks.append(covered.reshape(height, _FINER, width, _FINER).any(axis=(1, 3)))
        np.savez(stored, images=np.array(images), is_surface=np.array(masks))
    return dict(np.load(stored, allow_pickle=False))


@cache
def _sources() -> str:
    """Digest of relume's sources, which our images depend on."""
    folder = Path(relume.__file__).parent
    return digest([path.read_bytes() for path in sorted(folder.rglob("*.py"))])


def _render_mitsuba(path: Path, scene: Scene, shots: Sequence[tuple[str, str]], sizes: AssetSizes) -> F32:
    """Independent images of the shots. (shots, passes, height, width, 3)"""
    cameras = {camera.name: camera for camera in scene.cameras}
    arrays, job = make_job(read_file(path))
    job |= {
        "spp": [sizes.spp], "passes": sizes.passes, "size": list(sizes.size), "noise": _NOISE, "rounds": _ROUNDS,
        "most": sizes.spp,
        "shots": [
            {"camera": f"camera {view}", "yfov": cameras[view].yfov, "environment": environment}
            for environment, view in shots
        ],
    }  # fmt: skip
    arrays |= {f"camera {view}": cameras[view].to_world for _, view in shots}
    arrays |= {environment: map_for_mitsuba(environment_of(environment).radiance) for environment, _ in shots}
    key = (job, {name: digest(np.ascontiguousarray(values).tobytes()) for name, values in arrays.items()})
    return cache_passes(key, lambda folder: run_peer(arrays, job, folder), "gltf")


def _errors(pictures: Pictures) -> dict[str, float]:
    image, is_surface, passes = pictures
    comparison = compare_pixels(image, passes, is_surface)
    mean, halves = passes.mean(axis=0, dtype=np.float64), [passes[k::2].mean(axis=0, dtype=np.float64) for k in (0, 1)]
    displayed = [tone_map(picture.astype(np.float32), 0.0, "agx") for picture in (image, mean)]
    difference = np.abs(displayed[0] - displayed[1]).max(axis=2)[is_surface]
    noisy, noisier = (
        float(np.mean([hdr_flip(image, other)[is_surface].mean() for other in others])) for others in ([mean], halves)
    )
    return {
        "rmse": comparison.error.value if comparison.is_significant else comparison.limit,
        "rmse_standard_error": comparison.error.standard_error,
        **comparison.context,
        "flip": without_noise(noisy, noisier),
        "flip_with_noise": noisy,
        "p99": float(np.percentile(difference, 99)),
        "surface_share": float(is_surface.mean()),
    }
