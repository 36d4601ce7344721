"""free_camera.rmse_median, .rmse_worst, .blots: images of a moving free camera in many scenes.

The built-in scenes and up to ten files of the shared data, evenly spaced among those of `relume_bench.asset_files`,
from two cameras each. The bake has the default quality. Surfaces are diffuse, or diffuse with a rough highlight
(`make_rough_terms`); textures, transparency and lights other than meshes are left out, so that both renderers have the
same scene: `relume_bench.assets` compares what is imported.

- RMSE against Mitsuba's full path tracer over pixels with surfaces, its noise removed; its upper bound if it is below
  the noise. The median and the worst of all images.
- Blots: share of these pixels that are brighter than 3 times the exact picture, or darker than a third of it. The exact
  picture is the static view after the camera stops. A hundredth of its mean luminance is added to both, so that
  differences of black do not count.

Mitsuba's images are stored (`relume_bench.mitsuba.cached_passes`).
"""

from __future__ import annotations

import tempfile
import traceback
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.core.color import luminance
from relume.live.free_camera.image_error import pixel_errors
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.openers import open_bake
from relume.live.opened.static_view import StaticViewBuilder
from relume.look import complete, validate
from relume.look.document import MAX_BOUNCES
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.examples.catalog import BUILT_IN, built_in
from relume.scene.model import Camera, Material, Scene
from relume.scene.scene_folder import make_scene
from relume.scene_io.import_scene import import_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process
from relume_bench.asset_files import asset_files
from relume_bench.assets import ENVIRONMENTS, environment_of, orbited
from relume_bench.figure import Figure, skipped
from relume_bench.indirect import PASSES
from relume_bench.mitsuba import bsdf, cached_passes, missing
from relume_bench.probes_reference import moving_picture
from relume_bench.scenes import shared_data
from relume_bench.standard_error import compare_pixels
from relume_worker.presets import PRESETS

F64 = NDArray[np.float64]

_NAMES = ("free_camera.rmse_median", "free_camera.rmse_worst", "free_camera.blots")
_UNIT = "%"
_NUM_FILES = 10
_MAX_ALBEDO, _MIN_ROUGHNESS = 0.8, 0.5
_BLOT, _BLACK = 3.0, 0.01
_DIFFUSE = ("lambert", "oren_nayar")


class FreeCameraSizes(NamedTuple):
    """Width and height of images; lights and probes of bakes; Mitsuba's paths a pixel and pass; numbers of scenes."""

    size: tuple[int, int]
    lights: int
    probes: int
    spp: int
    built_in: int
    files: int

    @classmethod
    def choose(cls, tiny: bool) -> FreeCameraSizes:
        """The measured sizes, or with `tiny` those of a trial run."""
        if tiny:
            return cls((32, 24), 60, 500, 2, 1, 1)
        return cls((320, 240), PRESETS["good"].num_lights, Recipe.num_probes, 32, len(BUILT_IN), _NUM_FILES)


def measure(tiny: bool) -> list[Figure]:
    """A bake of each scene, and three images of each camera."""
    if (why := missing()) is not None:
        return skipped(_NAMES, _UNIT, why)
    sizes = FreeCameraSizes.choose(tiny)
    images: dict[str, dict[str, float]] = {}
    failures: dict[str, str] = {}
    for name, scene in free_camera_scenes(sizes):
        try:
            images |= {f"{name}, {camera.name}": errors for camera, errors in _measure_scene(scene, sizes)}
        except Exception as error:  # the other scenes must still be measured
            traceback.print_exc()
            failures[name] = f"{type(error).__name__}: {error}"[:300]
    return summarize(images, failures, sizes)


def summarize(
    images: Mapping[str, Mapping[str, float]], failures: Mapping[str, str], sizes: FreeCameraSizes
) -> list[Figure]:
    """Summarize the errors of all images. Raises ValueError if all scenes failed.

    Args:
        images: errors by scene and camera. failures: reasons by scene. sizes: that were measured.
    """
    if not images:
        raise ValueError(f"no scene could be measured: {dict(failures)}")
    rmse = [errors["rmse"] for errors in images.values()]
    surface, blots = (sum(errors[key] for errors in images.values()) for key in ("surface_pixels", "blot_pixels"))
    context = {
        "images": len(images), "failed": dict(failures), "size": list(sizes.size), "lights": sizes.lights,
        "probes": sizes.probes, "spp": PASSES * sizes.spp,
    }  # fmt: skip
    worst_blots = max(errors["blot_pixels"] / errors["surface_pixels"] for errors in images.values())
    return [
        Figure(_NAMES[0], 100 * float(np.median(rmse)), _UNIT, {**context, "by_image": dict(images)}),
        Figure(_NAMES[1], 100 * max(rmse), _UNIT, {**context, "image": max(images, key=lambda k: images[k]["rmse"])}),
        Figure(_NAMES[2], 100 * blots / surface, _UNIT, {**context, "worst_image": 100 * worst_blots}),
    ]


def free_camera_scenes(sizes: FreeCameraSizes) -> Iterator[tuple[str, Scene]]:
    """Names and scenes: built-in ones, then files, in both environments in turn. sizes: numbers of both"""
    for name in list(BUILT_IN)[: sizes.built_in]:
        yield name, built_in(name)
    files = list(asset_files(shared_data()))
    spaced: list[int] = np.linspace(0, len(files) - 1, min(sizes.files, len(files))).astype(int).tolist()
    for k, (name, path) in enumerate(files[index] for index in spaced):
        yield name, import_scene(path, path.stem, environment_of(ENVIRONMENTS[k % len(ENVIRONMENTS)]))


def make_rough_terms(terms: Sequence[Mapping[str, Any]]) -> tuple[dict[str, Any], ...]:
    """Terms of a rough material of the same colors: a Lambert term, and a GGX term if any term has a highlight.

    Args:
        terms: of a material, as in a look document.
    """
    diffuse = np.sum([term["color"] for term in terms if term["model"] in _DIFFUSE] or [[0.0] * 3], axis=0)
    highlights = [term for term in terms if term["model"] not in _DIFFUSE]
    lambert = {"model": "lambert", "color": np.minimum(diffuse, _MAX_ALBEDO).tolist()}
    if not highlights:
        return (lambert,)
    params = highlights[0].get("params", {}) if highlights[0]["model"] == "ggx" else {}
    ggx = {
        "model": "ggx",
        "color": np.minimum(highlights[0]["color"], 1.0).tolist(),
        "params": {"roughness": max(_MIN_ROUGHNESS, params.get("roughness", 0.0)), "f0": params.get("f0", 0.04)},
    }
    return (ggx,) if not diffuse.any() else (lambert, ggx)


def make_rough_scene(scene: Scene, camera: Camera) -> Scene:
    """The scene with rough materials, its mesh lights, which have one side, and one camera."""
    lights = [light for light in scene.lights if light.fields["kind"] == "mesh"]
    emissive = {light.fields["material"] for light in lights}
    materials = [
        Material(material.name, make_rough_terms(material.terms), double_sided=material.name not in emissive)
        for material in scene.materials
    ]
    return make_scene(scene.name, scene.meshes, materials, [camera], scene.environment, lights=lights)


def _measure_scene(scene: Scene, sizes: FreeCameraSizes) -> Iterator[tuple[Camera, dict[str, float]]]:
    """Bake a scene, and yield the errors of the images of both cameras."""
    cameras = (scene.cameras[0], orbited(scene))
    rough = make_rough_scene(scene, cameras[0])
    view = cameras[0].name
    recipe = Recipe("probes", (view,), sizes.size, sizes.lights, num_probes=sizes.probes)
    with tempfile.TemporaryDirectory() as folder:
        bake = open_bake(bake_in_process(METHODS["probes"], rough, recipe, Path(folder) / "s.zarr"), Cache(4 << 30))
        assert isinstance(bake, BakedFreeCamera)
        static_views = StaticViewBuilder(bake.light_transport, rough)
        look = validate(complete({}, bake.default_look), bake.default_look)
        for camera in cameras:
            picture = moving_picture(bake, view, look, (camera, sizes.size))
            exact = render_image(bake, view, look, camera_and_size=(camera, sizes.size), static_views=static_views)
            errors = pixel_errors(picture.image(), exact, picture.gbuffer, look.display)
            yield (
                camera,
                _compare(picture.image(), exact, errors.is_surface > 0, _trace(scene, camera, sizes))
                | {"delta_e": float(errors.delta_e.sum() / errors.is_surface.sum())},
            )


def _trace(scene: Scene, camera: Camera, sizes: FreeCameraSizes) -> NDArray[np.float32]:
    """Mitsuba's independent images. (passes, height, width, 3)"""
    rough = make_rough_scene(scene, camera)
    emission = {light.fields["material"]: light.fields["emission"] for light in rough.lights}
    bsdfs = []
    for material in (rough.materials[mesh.material] for mesh in rough.meshes):
        bsdfs.append(bsdf(material.terms))
        if material.name in emission:
            radiance = {"type": "rgb", "value": emission[material.name]}
            bsdfs[-1]["emitter"] = {"type": "area", "radiance": radiance}
    integrator = {"type": "path", "max_depth": MAX_BOUNCES + 2, "rr_depth": 6}
    return cached_passes(
        rough, sizes.size, {"spp": [sizes.spp], "passes": PASSES, "bsdfs": bsdfs, "integrator": integrator}
    )


def _compare(
    image: NDArray[np.float32],
    exact: NDArray[np.float32],
    is_surface: NDArray[np.bool_],
    passes: NDArray[np.float32],
) -> dict[str, float]:
    """Errors of an image of a moving camera."""
    comparison = compare_pixels(image.astype(np.float64), passes, is_surface)
    rested = compare_pixels(exact.astype(np.float64), passes, is_surface)
    return {
        "rmse": comparison.error.value if comparison.is_significant else comparison.limit,
        "rmse_standard_error": comparison.error.standard_error,
        "bias": comparison.bias.value,
        "static_view_rmse": rested.error.value,
        "surface_pixels": int(is_surface.sum()),
        "blot_pixels": count_blots(image[is_surface], exact[is_surface]),
    }


def count_blots(radiance: NDArray[np.floating], exact: NDArray[np.floating]) -> int:
    """Number of pixels more than `_BLOT` times brighter or darker than the exact ones.

    Args:
        radiance, exact: linear radiance of pixels. (n, 3)
    """
    ours, reference = (luminance(values.astype(np.float64)) for values in (radiance, exact))
    black = _BLACK * reference.mean()
    ratio = (ours + black) / (reference + black)
    return int(((ratio > _BLOT) | (ratio < 1 / _BLOT)).sum())
