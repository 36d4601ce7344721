"""View samples: the points of a view whose radiance makes its pixels.

One sample a pixel, more where material, normal or depth change across it (docs/direct-light.md#algorithm): eight
positions are traced in such a pixel and those that see the same thing, turned alike, are merged into the most central
of them: a silhouette has eight levels of coverage for a few samples, and thin chrome several reflections.

A picture is looked at twice, window by window: for edges, then for samples, which go to files as they are found and are
read from there in their order (docs/adr/0013-plans-and-tiled-sampling.md).
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from relume.assets.environments.equirect import lookup
from relume.camera.camera_samples import CameraSetup, EdgePixels
from relume.camera.external_sort import Column, ExternalSort
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
from relume.scene.roughness_levels import levels_of_material, select_level

F32 = NDArray[np.float32]

BACKGROUND = 65_535
_SAMPLES_PER_SIDE = 2048  # of a pixel's samples, by the root of the number of pixels; a tuft of blades takes 1,600
_NUM_LEVELS = 256


_POINT_COLUMNS = ("position", "normal", "tangent")
_SURFACE_COLUMNS = ("diffuse", "specular", "uv", "roughness", "normal_length", "emission", "surface_normal")
_CHAIN_COLUMNS = ("mirror", "mirror_cosine", "mirror_tint")
_SAMPLE_COLUMNS = ("pixel", "weight", "material", "level", "transmittance", "camera", "is_mirrored", "alpha_sample")
_COLUMNS = (*_SAMPLE_COLUMNS, *_POINT_COLUMNS, *_SURFACE_COLUMNS, *_CHAIN_COLUMNS)
# to tell which samples light comes to through tinted glass
_REQUIRED_COLUMNS = (
    "material",
    "level",
    "position",
    "normal",
)


@dataclass(frozen=True)
class ViewSamples:
    """Samples sorted by material, by level of roughness, then along a Morton curve: neighbours in memory are neighbours
    in the picture.

    Attributes:
        pixel: row-major index. (n,) uint32
        weight: share of the pixel; the shares of a pixel sum to one, but for what lies behind glass. (n,) float32
        material: index into the scene's materials, `BACKGROUND` where the ray left the scene. (n,) uint16
        surface: points and textures; for background samples the position is the ray's direction and `diffuse` the
            environment's radiance in it.
        num_rays: how many were traced to find them.
        level: of roughness, see `relume.scene.roughness_levels`; 0 where the material has but one. (n,) uint8
        transmittance: what glass before a sample lets through. Samples on glass and those behind it, on mirrors and
            those seen in them, have the same shares of a pixel. Where light comes to a sample through tinted glass,
            several stand in its place, which share its `weight`, and this says how (`relume.camera.spectral_split`).
            (n, 3) float32
        camera: where each is seen from: the camera, or the last surface that bent the path to it. (n, 3) float32
        chain: the mirrors that it is seen in, `NO_MIRROR` where it is seen in fewer.
        is_mirrored: whether its surface is a mirror, and other samples have what is seen in it. (n,)
        alpha_sample: of its rays at surfaces that blend, see `relume.raytrace.surface_points.SurfacePoints`. (n,)
            float32
    """

    pixel: NDArray[np.uint32]
    weight: F32
    material: NDArray[np.uint16]
    surface: SurfaceInteraction
    num_rays: int
    level: NDArray[np.uint8]
    transmittance: F32
    camera: F32
    chain: SpecularChain
    is_mirrored: NDArray[np.bool_]
    alpha_sample: F32

    @classmethod
    def from_columns(cls, columns: Mapping[str, Any], num_rays: int) -> ViewSamples:
        """Those of columns as `sampled` names them, which are read. num_rays: that were traced."""
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
    def throughput(self) -> F32:
        """What the radiance of each sample is multiplied by for its pixel, mirrors apart. (n, 3) float32"""
        return self.weight[:, None] * self.transmittance


def dither_thresholds(pixel: NDArray[np.int64], width: int) -> F32:
    """Numbers between 0 and 1 that differ much from pixel to pixel (interleaved gradient noise, Jimenez 2014).

    Args:
        pixel: row-major numbers. (n,) width: of the picture.
    Returns:
        (n,) float32
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
        scene: what is seen. geometry: its triangles.
        view: name of the camera. size: width and height in pixels.
        traces_mirrors: whether what is seen in mirrors has samples.
        smooths_edges: whether pixels across edges have several; else each shows what is seen through its middle.
        by_channel: whether samples that see light through tinted glass are split by channel, not by tint.
    """
    setup = camera_setup(scene, geometry, view, size, traces_mirrors=traces_mirrors)
    return ViewSamples.from_columns(
        *sample_pixels(setup, io.BytesIO, smooths_edges=smooths_edges, by_channel=by_channel)
    )


def camera_setup(
    scene: Scene, geometry: SceneBuffers, view: str, size: tuple[int, int], *, traces_mirrors: bool = True
) -> CameraSetup:
    """The eye of a view. See `sample_view`."""
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
    """Find the view samples of an eye, of which no more than a window's are in memory.

    Args:
        camera_setup: that sees them. scratch: opens a file that is gone when it is closed.
        names: of the columns that are wanted. smooths_edges, by_channel: see `sample_view`.
    Returns:
        The columns of `ViewSamples`, of its surface, points and chain, by name; how many rays were traced.
    """
    edges, size, materials = (
        camera_setup.find_edges(smooths=smooths_edges),
        camera_setup.size,
        camera_setup.scene.materials,
    )
    num_rays, sample_limit = edges.num_rays, view_sample_limit(materials, size[0] * size[1])
    for positions in PATTERNS:
        rows, num_traced = _sample_tiles(
            camera_setup, edges, positions, sample_limit, scratch, {*names, *_REQUIRED_COLUMNS}
        )
        num_rays += num_traced
        if rows is not None:
            break
    assert rows is not None  # for two samples of each pixel there is room
    columns = rows.columns()
    if num_tints(materials):
        split, num_traced = _split_tinted(camera_setup, columns, sample_limit, by_channel=by_channel)
        columns, num_rays = {**columns, **split}, num_rays + num_traced
    return {name: columns[name] for name in names}, num_rays


def _sample_tiles(
    camera_setup: CameraSetup,
    edges: EdgePixels,
    positions: NDArray[np.float64],
    sample_limit: int,
    scratch: Callable[[], IO[bytes]],
    names: Collection[str],
) -> tuple[ExternalSort | None, int]:
    """Find samples window by window.

    Args:
        camera_setup: that sees them. edges: of its picture. positions: of the rays in each pixel across edges. (n, 2)
        sample_limit: samples that there is room for. scratch, names: see `sampled`.
    Returns:
        None where they are more than there is room for; how many rays were traced.
    """
    rows, num_samples, num_rays = ExternalSort(scratch), edges.num_single_samples, 0

    def process_tile(tile: ImageTile) -> tuple[dict[str, NDArray[Any]], int, int]:
        rays, num_edge_samples, num_traced = camera_setup.trace_tile(tile, edges.is_edge, positions)
        return _sorted_samples(camera_setup, rays), num_edge_samples, num_traced

    for columns, num_edge_samples, num_traced in map_ordered(
        process_tile, image_tiles(camera_setup.size), MAX_CONCURRENT_TILES
    ):
        num_samples, num_rays = num_samples + num_edge_samples, num_rays + num_traced
        if num_samples > sample_limit:
            return None, num_rays
        rows.add(_sort_key(columns["material"], columns["level"]), {name: columns[name] for name in names})
    return rows, num_rays


def view_sample_limit(materials: Sequence[Material], num_pixels: int) -> int:
    """Bound the samples of a view: each position of a pixel sees something else, glass before it, more in mirrors.

    Edges are lines: twice as many pixels a side are twice as many edges among four times as many pixels. So a large
    picture has room for fewer samples of each pixel; where leaves or hair would take more, edges have fewer positions.

    Args:
        materials: of the scene. num_pixels: of the picture.
    """
    samples_per_pixel = min(max(_SAMPLES_PER_SIDE / math.sqrt(num_pixels), len(PATTERNS[-1])), POSITIONS_PER_PIXEL)
    return math.ceil(samples_per_pixel * num_pixels) * max_samples(materials)


def _sort_key(material: NDArray[np.uint16], level: NDArray[np.uint8]) -> NDArray[np.int32]:
    """What samples are sorted by, before their places in the picture. (n,)"""
    return material.astype(np.int32) * _NUM_LEVELS + level


def _roughness_levels(scene: Scene, material: NDArray[np.uint16], roughness: F32, threshold: F32) -> NDArray[np.uint8]:
    """The level of roughness of each sample, by its material. (n,)"""
    level = np.zeros(len(material), np.uint8)
    for index, scene_material in enumerate(scene.materials):
        if ratios := levels_of_material(scene_material):
            rows = np.flatnonzero(material == index)
            level[rows] = select_level(ratios, roughness[rows], threshold[rows])
    return level


def _sorted_samples(camera_setup: CameraSetup, rays: MergedRays) -> dict[str, NDArray[Any]]:
    """Make samples of rays. Returns columns by name, sorted as `ViewSamples` are."""
    scene, geometry, width = camera_setup.scene, camera_setup.geometry, camera_setup.size[0]
    is_hit = rays.layer.hits.face >= 0
    face = np.maximum(rays.layer.hits.face, 0)
    material = np.where(is_hit, geometry.face_material[face], BACKGROUND).astype(np.uint16)
    order = np.lexsort((morton(rays.pixel, width), material))
    layer = rays.layer.rows(order)
    surface = surface_at(geometry, layer.hits, layer.directions, scene.materials, camera_setup.pixel_angle)
    level = _roughness_levels(scene, material[order], surface.roughness, dither_thresholds(rays.pixel[order], width))
    if level.any():
        by_level = np.lexsort((level, material[order]))
        order, surface, layer, level = order[by_level], surface.rows(by_level), layer.rows(by_level), level[by_level]
    is_background = ~is_hit[order]
    surface.diffuse[is_background] = lookup(scene.environment.radiance, layer.directions[is_background])
    assert layer.chain is not None
    return {
        "pixel": rays.pixel[order].astype(np.uint32), "weight": rays.weight[order], "material": material[order],
        "level": level, "transmittance": layer.transmittance, "camera": layer.origins, "is_mirrored": layer.is_mirrored,
        "alpha_sample": np.zeros(len(order), np.float32),
        **{name: getattr(surface.points, name) for name in _POINT_COLUMNS},
        **{name: getattr(surface, name) for name in _SURFACE_COLUMNS},
        **dict(zip(_CHAIN_COLUMNS, layer.chain, strict=True)),
    }  # fmt: skip


def _split_tinted(
    camera_setup: CameraSetup, columns: Mapping[str, Column], sample_limit: int, *, by_channel: bool
) -> tuple[dict[str, Any], int]:
    """Split samples that light reaches through tinted glass; none where they were too many.

    Args:
        camera_setup: that sees the samples. columns: of them. sample_limit: samples that a plan has room for.
        by_channel: see `sample_view`.
    Returns:
        Columns in place of those; how many rays were traced.
    """
    key = _sort_key(np.asarray(columns["material"]), np.asarray(columns["level"]))
    num, num_surface = len(key), int(np.searchsorted(key, BACKGROUND * _NUM_LEVELS))
    light = TintedLight(camera_setup.geometry, camera_setup.scene.environment.radiance)
    tints, num_rays = np.full((num, light.num_groups, 3), np.nan, np.float32), 0
    for start in range(0, num_surface, POINTS_PER_BLOCK):
        block = slice(start, min(start + POINTS_PER_BLOCK, num_surface))
        tints[block], num_traced = light.tints(columns["position"][block], columns["normal"][block])
        num_rays += num_traced
    split = TintSplit(tints, np.append(np.flatnonzero(np.diff(key, prepend=-1)), num), by_channel=by_channel)
    if len(split.row) > sample_limit:
        return {}, num_rays
    return {name: SplitColumn(name, column, split) for name, column in columns.items()}, num_rays
