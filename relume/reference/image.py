"""Reference images by brute force, over the view samples of a bake: only light transport differs, not antialiasing.

Renders all light paths and the light paths of a method with the same random numbers, so that the two images differ only
by the paths that the method omits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.environment_names import load_environment
from relume.assets.environments.equirect import lookup, rotate_about_y
from relume.camera.specular_hits import is_mirror_material
from relume.camera.view_samples import BACKGROUND, ViewSamples, sample_view
from relume.core.errors import CancelledError
from relume.lights.tile_subdivision import MIN_LIGHTS
from relume.look import LightPaths, Look
from relume.methods.direct import DirectMethod
from relume.raytrace.scene_buffers import SceneBuffers, build_scene_buffers
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE
from relume.reference.emitters import ReferenceEmitter, emitted_radiance, emitters
from relume.reference.environment_samples import EnvironmentSamples, environment_texels
from relume.reference.links import lit_meshes
from relume.reference.path_tracing import reference_indirect
from relume.reference.paths import omitted_paths, unlimited_paths, unsupported_paths
from relume.reference.radiance import ReferencePoints, reference_radiance
from relume.reference.roughness_classes import roughness_classes
from relume.reference.textures import surface_roughness, surface_textures, with_overrides
from relume.scene.model import Scene
from relume.scene.roughness_levels import slope_variance
from relume.store.bake_protocol import Recipe
from relume.views.frost_filter import make_frost_filter

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SPP_PER_PATH = 16  # environment samples per path vertex
_POINTS_PER_BLOCK = 4096
_DIRECT_FRACTION = 0.2  # of the time, if there is indirect light


def reference_image(
    scene: Scene,
    view: str,
    look: Look,
    size: tuple[int, int],
    spp: int,
    progress: Callable[[float], object] = lambda share: None,
    is_canceled: Callable[[], bool] = lambda: False,
    pass_index: int = 0,
    *,
    reflects: bool = False,
) -> Shaped[F32, "height width 3"]:
    """Render a look with all its lights, with shadows, by the light paths of a method.

    Args:
        scene, view, look, size, spp, progress, is_canceled, pass_index: as in `render_reference`.
        reflects: the method has indirect light, as chosen by the look's `transport`.
    Returns:
        Linear radiance, with the background.
    """
    light_paths = [look.transport.supported_by(has_indirect=reflects)]
    return _render_paths(scene, view, look, size, _Draw(spp, pass_index, is_canceled), light_paths, progress)[0]


@dataclass(frozen=True)
class ReferenceImage:
    """Images of one reference pass.

    Attributes:
        all_paths_image: image with all light paths; None if not requested.
        method_image: image with the light paths of the method.
        omitted_paths: paths that the method omits; unsupported_paths: paths that the reference omits too. In sentences.
    """

    all_paths_image: Shaped[F32, "height width 3"] | None
    method_image: Shaped[F32, "height width 3"]
    omitted_paths: tuple[str, ...]
    unsupported_paths: tuple[str, ...]

    @property
    def pictures(self) -> dict[str, F32]:
        """Images by their paths: "method", and "all" if requested."""
        return {"method": self.method_image} | ({} if self.all_paths_image is None else {"all": self.all_paths_image})


def render_reference(
    scene: Scene,
    view: str,
    look: Look,
    size: tuple[int, int],
    spp: int,
    progress: Callable[[float], object] = lambda share: None,
    is_canceled: Callable[[], bool] = lambda: False,
    pass_index: int = 0,
    *,
    reflects: bool = False,
    is_whole: bool = True,
) -> ReferenceImage:
    """Render a look with all light paths and with the paths of a method, from the same random numbers.

    Args:
        scene: the scene. view: one of its cameras. look: the look.
        size: width and height in pixels.
        spp: environment texels per view sample, sampled by power with a fixed seed, and points per area light; 0, or as
            many as the map has, for every texel. There is one indirect path per `_SPP_PER_PATH` of them.
        progress: called with the finished fraction. is_canceled: called regularly.
        pass_index: images with other indices have independent samples.
        reflects: the method has indirect light.
        is_whole: all paths are requested.
    Raises:
        PlanError: the scene has no such view, or a bake of this size would be rejected.
        CancelledError: `is_canceled` returned true.
        NotFoundError: the look names an environment that does not exist.
    """
    light_paths = [look.transport.supported_by(has_indirect=reflects), *([unlimited_paths(look)] if is_whole else [])]
    images = _render_paths(scene, view, look, size, _Draw(spp, pass_index, is_canceled), light_paths, progress)
    return ReferenceImage(
        images[1] if is_whole else None, images[0], omitted_paths(look, reflects=reflects), unsupported_paths(scene)
    )


def _render_paths(
    scene: Scene, view: str, look: Look, size: tuple[int, int], draw: _Draw, light_paths: Sequence[LightPaths],
    progress: Callable[[float], object],
) -> list[F32]:  # fmt: skip
    """Render one image for each selection of paths."""
    DirectMethod().plan(scene, Recipe("direct", (view,), size, MIN_LIGHTS))  # rejects what a bake rejects
    setup = _prepare_view(with_overrides(scene, look), view, look, size)
    is_direct = np.array([paths.direct for paths in light_paths], np.float64)
    has_indirect = any(paths.has_indirect for paths in light_paths) or (
        is_direct.any() and is_mirror_material(scene.materials).any()
    )
    direct_fraction = _DIRECT_FRACTION if has_indirect else 1.0
    radiance = np.zeros((len(light_paths), len(setup.samples.pixel), 3))
    if is_direct.any():
        direct_radiance = np.zeros(radiance.shape[1:])
        _add_direct(direct_radiance, setup, draw, lambda share: progress(direct_fraction * share))
        _add_background(direct_radiance, setup)
        radiance += is_direct[:, None, None] * direct_radiance
    if has_indirect:
        _add_indirect(
            radiance, setup, light_paths, draw, lambda share: progress(direct_fraction + (1 - direct_fraction) * share)
        )
    return [_resolve(setup.samples, path_radiance, size) for path_radiance in radiance]


@dataclass(frozen=True)
class _ViewSetup:
    """Samples of a view, and the lights of its look.

    Attributes:
        points: points of `samples`, which are sorted by material.
        light: the environment of the look; texels: rotated and scaled by the look.
    """

    scene: Scene
    geometry: SceneBuffers
    look: Look
    samples: ViewSamples
    points: ReferencePoints
    light: Environment
    texels: EnvironmentSamples
    local_lights: Sequence[ReferenceEmitter]

    def samples_of(self, material: int) -> slice:
        """Samples of a material."""
        first, last = np.searchsorted(self.samples.material, (material, material + 1))
        return slice(int(first), int(last))

    @property
    def on_surface(self) -> slice:
        """Surface samples; they precede those of the background."""
        return slice(0, int(np.searchsorted(self.samples.material, len(self.scene.materials))))


@dataclass(frozen=True)
class _Draw:
    """Sampling parameters and cancellation."""

    spp: int
    pass_index: int
    is_canceled: Callable[[], bool]


def _prepare_view(scene: Scene, view: str, look: Look, size: tuple[int, int]) -> _ViewSetup:
    """Trace a view's samples and load the look's environment."""
    geometry = build_scene_buffers(scene)
    # here mirrors are lobes like others, and light through tinted glass is traced per channel, not by mean tints
    samples = sample_view(scene, geometry, view, size, traces_mirrors=False, by_channel=True)
    light = scene.environment if look.environment.map is None else load_environment(look.environment.map)
    texels = environment_texels(light, look.environment.rotation).scaled(look.environment.gain)
    texels = replace(texels, lit_meshes=lit_meshes(scene, look.environment.link))
    look_args = scene, look, samples.surface, samples.material
    points = points_of_samples(samples, surface_textures(*look_args), surface_roughness(*look_args))
    return _ViewSetup(scene, geometry, look, samples, points, light, texels, emitters(scene, geometry, look))


def _add_direct(radiance: F64, setup: _ViewSetup, draw: _Draw, progress: Callable[[float], object]) -> None:
    """Add direct light, and the emission of surfaces."""
    num_samples, classes = max(1, setup.on_surface.stop), roughness_classes(setup.scene, setup.look)
    class_index = classes.classify(setup.samples.material[setup.on_surface], setup.points.samples_of(setup.on_surface))
    done = 0
    for index, terms in enumerate(classes.terms):
        class_rows = np.flatnonzero(class_index == index)

        def report_fraction(fraction: float, num_before: int = done, num: int = len(class_rows)) -> None:
            progress((num_before + fraction * num) / num_samples)

        radiance[class_rows] += reference_radiance(
            setup.geometry, setup.texels, setup.points.samples_of(class_rows), [terms], draw.spp,
            report_fraction, draw.is_canceled, draw.pass_index, setup.local_lights,
        )[0]  # fmt: skip
        done += len(class_rows)
    for index, material in enumerate(setup.scene.materials):
        rows = setup.samples_of(index)
        if (emission := emitted_radiance(setup.local_lights, material.name)).any():
            front = setup.geometry.is_front(setup.samples.camera[rows], setup.points.position[rows])
            is_emissive_side = (front | material.double_sided)[:, None]
            radiance[rows] += emission * is_emissive_side * setup.samples.surface.emission[rows]


def _add_background(radiance: F64, setup: _ViewSetup) -> None:
    """Add the environment to background samples."""
    environment, is_background = setup.look.environment, setup.samples.material == BACKGROUND
    direction = rotate_about_y(
        setup.samples.surface.points.position[is_background].astype(np.float64), -environment.rotation
    )
    radiance[is_background] += np.array(environment.gain) * lookup(setup.light.radiance, direction.astype(np.float32))


def _add_indirect(
    radiance: F64,
    setup: _ViewSetup,
    light_paths: Sequence[LightPaths],
    draw: _Draw,
    progress: Callable[[float], object],
) -> None:
    """Add indirect light and light by way of mirrors, block by block. radiance: (light_paths, samples, 3)"""
    num_points = setup.on_surface.stop
    num_blocks, num_paths = -(-num_points // _POINTS_PER_BLOCK), max(1, draw.spp // _SPP_PER_PATH)
    for block in range(num_blocks):
        if draw.is_canceled():
            raise CancelledError("the reference was canceled")
        rows = slice(block * _POINTS_PER_BLOCK, min((block + 1) * _POINTS_PER_BLOCK, num_points))
        indirect = reference_indirect(
            setup.scene, setup.geometry, setup.texels, setup.look, setup.points.samples_of(rows),
            setup.samples.material[rows],
            light_paths, num_paths, _SPP_PER_PATH, seed=draw.pass_index * num_blocks + block,
        )  # fmt: skip
        radiance[:, rows] += indirect.mean
        progress((block + 1) / num_blocks)


def points_of_samples(
    samples: ViewSamples, textures: Mapping[str, F32], roughness: Shaped[F32, " n"]
) -> ReferencePoints:
    """Convert view samples to points; points of background samples are meaningless.

    samples: samples of a view. textures, roughness: textures and roughness at the samples, see `ReferencePoints`.
    """
    points = samples.surface.points
    to_camera = samples.camera.astype(np.float64) - points.position
    wo = (to_camera / np.linalg.norm(to_camera, axis=1, keepdims=True)).astype(np.float32)
    alpha_sample = samples.alpha_sample if samples.alpha_sample.any() else FIXED_ALPHA_SAMPLE
    return ReferencePoints(
        points.position,
        points.normal,
        points.tangent,
        wo,
        textures,
        roughness,
        samples.surface.uv,
        alpha_sample,
        slope_variance(samples.surface.normal_length),
    )


def _resolve(samples: ViewSamples, radiance: F64, size: tuple[int, int]) -> F32:
    """Sum samples to pixels by their weights. (height, width, 3)"""
    width, height = size
    weighted = samples.throughput * radiance
    pixels = _sums(samples.pixel, weighted, width * height)
    columns = samples.frost, samples.material, samples.pixel, samples.weight
    frost = make_frost_filter(*columns, np.argsort(samples.pixel, kind="stable").astype(np.int32), width)
    if frost is not None:
        is_frosted = samples.frost > 0
        frosted = _sums(samples.pixel[is_frosted], weighted[is_frosted], width * height)
        pixels[frost.pixel] += frost.change @ frosted[frost.pixel]
    return pixels.reshape(height, width, 3).astype(np.float32)


def _sums(pixel: NDArray[np.uint32], values: F64, num_pixels: int) -> F64:
    """Sum values of samples (n, 3) to pixels (num_pixels, 3)."""
    return np.stack([np.bincount(pixel, values[:, c], num_pixels) for c in range(3)], axis=-1)
