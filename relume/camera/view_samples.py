"""View sampling: choose the surface points of a view whose weighted radiances sum to its pixels.

Pixels have one sample, or more where material, normal or depth change (docs/direct-light.md#algorithm): eight positions
of such a pixel are traced, and rays that hit the same surface with similar normals are merged into the most central
one. A silhouette then has eight levels of coverage for a few samples, and thin chrome several reflections.

An image is traced twice, tile by tile: for edges, then for samples. Samples are written to files and read back in
sorted order (docs/adr/0013-plans-and-tiled-sampling.md).
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import IO, Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import lookup
from relume.camera.camera_samples import CameraSetup
from relume.camera.external_sort import Column, ExternalSort
from relume.camera.lens_rays import RAYS_PER_PIXEL, trace_lens_tile
from relume.camera.lens_rays import TILE_SIZE as LENS_TILE_SIZE
from relume.camera.merge_rays import PATTERNS, POSITIONS_PER_PIXEL, MergedRays
from relume.camera.ray_paths import SpecularChain
from relume.camera.spectral_split import POINTS_PER_BLOCK, SplitColumn, TintedLight, TintSplit, num_tints
from relume.camera.tiling import MAX_CONCURRENT_TILES, ImageTile, image_tiles, morton
from relume.camera.transparency_layers import max_samples
from relume.core.thread_pools import map_ordered
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import SurfaceInteraction, surface_at
from relume.raytrace.surface_points import SurfacePoints
from relume.scene.model import Material, Scene
from relume.scene.roughness_levels import levels_of_material, slope_variance

F32 = NDArray[np.float32]

BACKGROUND = 65_535
_SAMPLES_PER_SIDE = 2048  # limit of samples per pixel times √pixels; a tuft of grass needs 1,600
_LENS_RATIO = 8  # by which a lens raises it
_NUM_LEVELS = 256


_POINT_COLUMNS = ("position", "normal", "tangent")
_SURFACE_COLUMNS = ("diffuse", "specular", "uv", "roughness", "normal_length", "emission", "surface_normal")
_CHAIN_COLUMNS = ("mirror", "mirror_cosine", "mirror_tint")
_SAMPLE_COLUMNS = (
    "pixel",
    "weight",
    "material",
    "level",
    "transmittance",
    "camera",
    "is_mirrored",
    "frost",
    "alpha_sample",
)
_COLUMNS = (*_SAMPLE_COLUMNS, *_POINT_COLUMNS, *_SURFACE_COLUMNS, *_CHAIN_COLUMNS)
# required to find samples that light reaches through tinted glass
_REQUIRED_COLUMNS = ("material", "level", "position", "normal")


@dataclass(frozen=True)
class ViewSamples:
    """Samples sorted by material, by roughness level, then along a Morton curve: neighbors in memory are neighbors in
    the image.

    Attributes:
        pixel: row-major index.
        weight: fraction of the pixel; the weights of a pixel sum to one, apart from samples behind glass.
        material: index into the scene's materials, `BACKGROUND` if the ray left the scene.
        surface: points and textures; for background samples the position is the ray's direction and `diffuse` the
            radiance of the environment.
        num_rays: number of traced rays.
        level: roughness level, see `relume.scene.roughness_levels`; 0 if the material has only one.
        transmittance: transmittance of glass between the sample and the camera. Samples on glass and behind it, on
            mirrors and in them, have the same weight. If light reaches a sample through tinted glass, several samples
            replace it; they share its `weight`, and this contains their channel weights
            (`relume.camera.spectral_split`).
        camera: origin of the view direction: the camera, or the last surface that changed the path's direction.
        chain: mirrors on the path, padded with `NO_MIRROR`.
        is_mirrored: the surface is a mirror, and other samples have its reflection.
        frost: 1 + index of the material of the first frosted glass before the sample; 0 for none.
        alpha_sample: alpha samples for rays at blended surfaces, see `relume.raytrace.surface_points.SurfacePoints`.
    """

    pixel: Shaped[NDArray[np.uint32], " n"]
    weight: Shaped[F32, " n"]
    material: Shaped[NDArray[np.uint16], " n"]
    surface: SurfaceInteraction
    num_rays: int
    level: Shaped[NDArray[np.uint8], " n"]
    transmittance: Shaped[F32, "n 3"]
    camera: Shaped[F32, "n 3"]
    chain: SpecularChain
    is_mirrored: Shaped[NDArray[np.bool_], " n"]
    frost: Shaped[NDArray[np.uint16], " n"]
    alpha_sample: Shaped[F32, " n"]

    @classmethod
    def from_columns(cls, columns: Mapping[str, Any], num_rays: int) -> ViewSamples:
        """Read samples from columns as `sample_pixels` names them. num_rays: number of traced rays"""
        arrays = {name: np.asarray(columns[name]) for name in _COLUMNS}
        seed = np.arange(len(arrays["pixel"]), dtype=np.uint32)
        points = SurfacePoints(seed=seed, **{name: arrays[name] for name in _POINT_COLUMNS})
        return cls(
            surface=SurfaceInteraction(points, **{name: arrays[name] for name in _SURFACE_COLUMNS}),
            chain=SpecularChain(*(arrays[name] for name in _CHAIN_COLUMNS)),
            num_rays=num_rays,
            **{name: arrays[name] for name in _SAMPLE_COLUMNS},
        )

    @property
    def throughput(self) -> Shaped[F32, "n 3"]:
        """Factor of each sample's radiance in its pixel: weight · transmittance, without mirrors."""
        return self.weight[:, None] * self.transmittance


def dither_thresholds(pixel: Shaped[NDArray[np.int64], " n"], width: int) -> Shaped[F32, " n"]:
    """Interleaved gradient noise in [0, 1), which differs strongly between neighboring pixels (Jimenez 2014).

    Args:
        pixel: row-major indices. width: width of the image.
    """
    y, x = np.divmod(pixel, width)
    return np.asarray((52.9829189 * ((0.06711056 * x + 0.00583715 * y) % 1)) % 1, np.float32)


def sample_view(
    scene: Scene,
    geometry: SceneBuffers,
    view: str,
    size: tuple[int, int],
    *,
    traces_mirrors: bool = True,
    smooths_edges: bool = True,
    by_channel: bool = False,
) -> ViewSamples:
    """Find the view samples of one camera, in memory.

    Args:
        scene: the scene. geometry: its triangles.
        view: name of the camera. size: width and height in pixels.
        traces_mirrors: add samples of reflections in mirrors.
        smooths_edges: take several samples in edge pixels; otherwise all pixels have one at their center.
        by_channel: split samples that light reaches through tinted glass by channel instead of by tint.
    """
    setup = camera_setup(scene, geometry, view, size, traces_mirrors=traces_mirrors)
    return ViewSamples.from_columns(
        *sample_pixels(setup, io.BytesIO, smooths_edges=smooths_edges, by_channel=by_channel)
    )


def camera_setup(
    scene: Scene, geometry: SceneBuffers, view: str, size: tuple[int, int], *, traces_mirrors: bool = True
) -> CameraSetup:
    """Set up the camera of a view. See `sample_view`."""
    camera = next(camera for camera in scene.cameras if camera.name == view)
    return CameraSetup(scene, geometry, camera, size, traces_mirrors)


def sample_pixels(
    camera_setup: CameraSetup,
    scratch: Callable[[], IO[bytes]],
    names: Sequence[str] = _COLUMNS,
    *,
    smooths_edges: bool = True,
    by_channel: bool = False,
) -> tuple[dict[str, Column], int]:
    """Find the view samples of a camera, with no more than a few tiles in memory.

    Args:
        camera_setup: the camera. scratch: opens a temporary file that is deleted when it is closed.
        names: names of the required columns. smooths_edges, by_channel: see `sample_view`.
    Returns:
        The columns of `ViewSamples`, of its surface, points and chain, by name; and the number of traced rays.
    """
    size, materials, has_lens = camera_setup.size, camera_setup.scene.materials, camera_setup.camera.lens is not None
    sample_limit = view_sample_limit(materials, size[0] * size[1], has_lens=has_lens)
    samplings = _lens_samplings(camera_setup) if has_lens else _edge_samplings(camera_setup, smooths=smooths_edges)
    num_rays = samplings[0].num_rays
    for sampling in samplings:
        rows, num_traced = _sample_tiles(camera_setup, sampling, sample_limit, scratch, {*names, *_REQUIRED_COLUMNS})
        num_rays += num_traced
        if rows is not None:
            break
    assert rows is not None  # two samples of each pixel always fit
    columns = rows.columns()
    if num_tints(materials):
        split, num_traced = _split_tinted(camera_setup, columns, sample_limit, by_channel=by_channel)
        columns, num_rays = {**columns, **split}, num_rays + num_traced
    return {name: columns[name] for name in names}, num_rays


class _Sampling(NamedTuple):
    """One of several ways to sample the tiles of an image.

    Attributes:
        trace_tile: returns merged rays, the number of those in pixels with several, and the number of traced rays.
        tiles: of the image. num_single_samples: samples of pixels with one ray. num_rays: rays traced before.
    """

    trace_tile: Callable[[ImageTile], tuple[MergedRays, int, int]]
    tiles: list[ImageTile]
    num_single_samples: int
    num_rays: int


def _edge_samplings(setup: CameraSetup, *, smooths: bool) -> list[_Sampling]:
    """Samplings of a camera without a lens, with ever fewer rays in edge pixels."""
    edges, tiles = setup.find_edges(smooths=smooths), image_tiles(setup.size)
    trace_tile = setup.trace_tile
    return [
        _Sampling(
            partial(trace_tile, pixels=edges, positions=positions), tiles, edges.num_single_samples, edges.num_rays
        )
        for positions in PATTERNS
    ]


def _lens_samplings(setup: CameraSetup) -> list[_Sampling]:
    """Samplings of a camera with a lens, with ever fewer rays."""
    tiles = image_tiles(setup.size, LENS_TILE_SIZE)
    return [_Sampling(partial(trace_lens_tile, setup, max_rays=num), tiles, 0, 0) for num in RAYS_PER_PIXEL]


def _sample_tiles(
    camera_setup: CameraSetup,
    sampling: _Sampling,
    sample_limit: int,
    scratch: Callable[[], IO[bytes]],
    names: Collection[str],
) -> tuple[ExternalSort | None, int]:
    """Find samples tile by tile.

    Args:
        camera_setup: the camera. sampling: of its image.
        sample_limit: maximum number of samples. scratch, names: see `sample_pixels`.
    Returns:
        The samples, None if they exceed the limit; and the number of traced rays.
    """
    rows, num_samples, num_rays = ExternalSort(scratch), sampling.num_single_samples, 0

    def process_tile(tile: ImageTile) -> tuple[dict[str, NDArray[Any]], int, int]:
        rays, num_edge_samples, num_traced = sampling.trace_tile(tile)
        return _sorted_samples(camera_setup, rays), num_edge_samples, num_traced

    for columns, num_edge_samples, num_traced in map_ordered(process_tile, sampling.tiles, MAX_CONCURRENT_TILES):
        num_samples, num_rays = num_samples + num_edge_samples, num_rays + num_traced
        if num_samples > sample_limit:
            return None, num_rays
        rows.add(_sort_key(columns["material"], columns["level"]), {name: columns[name] for name in names})
    return rows, num_rays


def view_sample_limit(materials: Sequence[Material], num_pixels: int, *, has_lens: bool = False) -> int:
    """Maximum number of samples of a view: several positions per pixel, times the layers of glass and mirrors.

    Edges are lines: twice the resolution has twice as many edge pixels among four times as many pixels. So a large
    image may have fewer samples per pixel; if leaves or hair need more, edges get fewer positions.

    Args:
        materials: materials of the scene. num_pixels: number of pixels of the image.
        has_lens: of the camera; blurred pixels have eight times as many samples.
    """
    per_side, most = (
        (_LENS_RATIO * _SAMPLES_PER_SIDE, RAYS_PER_PIXEL[0]) if has_lens else (_SAMPLES_PER_SIDE, POSITIONS_PER_PIXEL)
    )
    samples_per_pixel = min(max(per_side / math.sqrt(num_pixels), len(PATTERNS[-1])), most)
    return math.ceil(samples_per_pixel * num_pixels) * max_samples(materials)


def _sort_key(material: NDArray[np.uint16], level: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Sort key of samples before their position in the image. (n,)"""
    return material.astype(np.int32) * _NUM_LEVELS + level


def _roughness_levels(
    scene: Scene, material: NDArray[np.uint16], surface: SurfaceInteraction, threshold: F32
) -> NDArray[np.uint8]:
    """Roughness level of each sample, by its material. (n,)"""
    level, variance = np.zeros(len(material), np.uint8), slope_variance(surface.normal_length)
    for index, scene_material in enumerate(scene.materials):
        rows = np.flatnonzero(material == index)
        level[rows] = levels_of_material(scene_material).select(
            surface.roughness[rows], variance[rows], threshold[rows]
        )
    return level


def _sorted_samples(camera_setup: CameraSetup, rays: MergedRays) -> dict[str, NDArray[Any]]:
    """Make samples of rays. Returns columns by name, sorted like `ViewSamples`."""
    scene, geometry, width = camera_setup.scene, camera_setup.geometry, camera_setup.size[0]
    is_hit = rays.layer.hits.face >= 0
    face = np.maximum(rays.layer.hits.face, 0)
    material = np.where(is_hit, geometry.face_material[face], BACKGROUND).astype(np.uint16)
    order = np.lexsort((morton(rays.pixel, width), material))
    layer = rays.layer.rows(order)
    surface = surface_at(geometry, layer.hits, layer.directions, scene.materials, camera_setup.pixel_angle)
    level = _roughness_levels(scene, material[order], surface, dither_thresholds(rays.pixel[order], width))
    if level.any():
        by_level = np.lexsort((level, material[order]))
        order, surface, layer, level = order[by_level], surface.rows(by_level), layer.rows(by_level), level[by_level]
    is_background = ~is_hit[order]
    surface.diffuse[is_background] = lookup(scene.environment.radiance, layer.directions[is_background])
    assert layer.chain is not None
    return {
        "pixel": rays.pixel[order].astype(np.uint32), "weight": rays.weight[order], "material": material[order],
        "level": level, "transmittance": layer.transmittance, "camera": layer.origins, "is_mirrored": layer.is_mirrored,
        "frost": layer.frost,
        "alpha_sample": np.zeros(len(order), np.float32),
        **{name: getattr(surface.points, name) for name in _POINT_COLUMNS},
        **{name: getattr(surface, name) for name in _SURFACE_COLUMNS},
        **dict(zip(_CHAIN_COLUMNS, layer.chain, strict=True)),
    }  # fmt: skip


def _split_tinted(
    camera_setup: CameraSetup, columns: Mapping[str, Column], sample_limit: int, *, by_channel: bool
) -> tuple[dict[str, Any], int]:
    """Split samples that light reaches through tinted glass; return no columns if the limit is exceeded.

    Args:
        camera_setup: the camera. columns: columns of its samples. sample_limit: maximum number of samples of the plan.
        by_channel: see `sample_view`.
    Returns:
        Columns that replace the given ones; and the number of traced rays.
    """
    key = _sort_key(np.asarray(columns["material"]), np.asarray(columns["level"]))
    num, num_surface = len(key), int(np.searchsorted(key, BACKGROUND * _NUM_LEVELS))
    light = TintedLight(camera_setup.geometry, camera_setup.scene.environment.radiance)
    tints, num_rays = np.full((num, light.num_groups, 3), np.nan, np.float32), 0
    for start in range(0, num_surface, POINTS_PER_BLOCK):
        camera_setup.check_canceled()
        block = slice(start, min(start + POINTS_PER_BLOCK, num_surface))
        tints[block], num_traced = light.tints(columns["position"][block], columns["normal"][block])
        num_rays += num_traced
    split = TintSplit(tints, np.append(np.flatnonzero(np.diff(key, prepend=-1)), num), by_channel=by_channel)
    if len(split.row) > sample_limit:
        return {}, num_rays
    return {name: SplitColumn(name, column, split) for name, column in columns.items()}, num_rays
