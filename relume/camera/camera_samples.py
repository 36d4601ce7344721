"""Edge detection and camera rays for the view samples of one camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.camera.edge_detection import (
    find_edge_pixels,
    is_normal_edge,
    is_partial_coverage,
    is_radiance_edge,
    radiance_edge_threshold,
)
from relume.camera.merge_rays import MergedRays, concatenate_rays, merge_rays, unmerged
from relume.camera.refraction import glass_surfaces
from relume.camera.specular_hits import MAX_MIRROR_BOUNCES
from relume.camera.tiling import MAX_CONCURRENT_TILES, ImageTile, image_tiles
from relume.camera.transparency_layers import TransparencyLayer, trace_layers
from relume.core.thread_pools import map_ordered
from relume.raytrace.alpha_filter import NUM_OFFSETS, STOP_AT_OPAQUE
from relume.raytrace.camera_rays import camera_directions, near_distances
from relume.raytrace.scene_buffers import SceneBuffers
from relume.scene.model import Camera, Scene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_GOLDEN_RATIO_CONJUGATE = (5**0.5 - 1) / 2
_FACETS_PER_POSITION, _FACETS_PER_RAY = 2, 4  # of frosted glass; at successive surfaces, then from the first again
FROST_PERIOD = 4  # pixels; `relume.views.frost_filter` averages over as many
_PIXEL_CENTER = np.full((1, 2), 0.5)


@dataclass(frozen=True)
class EdgePixels:
    """Edge pixels of an image.

    Attributes:
        is_edge: true if a pixel needs more rays than the one through its center. is_frosted: true for those that show
            frosted glass, whose rays meet different facets.
        num_single_samples: total samples of the other pixels. num_rays: rays traced to find edges.
    """

    is_edge: Shaped[NDArray[np.bool_], " pixels"]
    is_frosted: Shaped[NDArray[np.bool_], " pixels"]
    num_single_samples: int
    num_rays: int


@dataclass(frozen=True)
class CameraSetup:
    """A camera in a scene.

    Attributes:
        scene: the scene. geometry: its triangles. camera: the camera. size: image width and height in pixels.
        traces_mirrors: trace rays that mirrors reflect.
        check_canceled: called for each tile; raises CancelledError if the samples are no longer needed.
    """

    scene: Scene
    geometry: SceneBuffers
    camera: Camera
    size: tuple[int, int]
    traces_mirrors: bool = True
    check_canceled: Callable[[], None] = lambda: None

    @property
    def pixel_angle(self) -> float:
        """Angle of a pixel, in radians."""
        return self.camera.yfov / self.size[1]

    @cached_property
    def _origin(self) -> F32:
        return self.camera.to_world[:3, 3].astype(np.float32)

    @cached_property
    def _edge_threshold(self) -> float:
        return radiance_edge_threshold(self.scene.environment.radiance)

    def _directions(self, pixel: NDArray[np.int64], positions: NDArray[np.float64] = _PIXEL_CENTER) -> F32:
        """Directions of rays through `positions` (n, 2) in each of `pixel` (p,), grouped by pixel. (p · n, 3)"""
        y, x = np.divmod(pixel, self.size[0])
        at_x, at_y = ((a[:, None] + positions[:, k]).astype(np.float32).ravel() for k, a in enumerate((x, y)))
        return camera_directions(self.camera, self.size, at_x, at_y)

    def trace_layers(
        self,
        directions: F32,
        alpha_sample: F32 | np.float32 = STOP_AT_OPAQUE,
        facets: F64 | None = None,
        origins: F32 | None = None,
    ) -> list[TransparencyLayer]:
        """Trace rays of the camera.

        Args:
            directions, alpha_sample, facets: see `relume.camera.transparency_layers.trace_layers`.
            origins: of each ray (n, 3); None: the camera.
        """
        self.check_canceled()
        origin = self._origin if origins is None else origins
        return trace_layers(
            self.geometry, self.scene.materials, origin, directions, alpha_sample, self.pixel_angle,
            traces_mirrors=self.traces_mirrors, facets=facets, start=near_distances(self.camera, directions),
        )  # fmt: skip

    def find_edges(self, *, smooths: bool) -> EdgePixels:
        """Find the edge pixels of the image. smooths: if false, no pixel is an edge."""
        num_pixels = self.size[0] * self.size[1]
        is_edge, num_visible = np.zeros(num_pixels, np.bool_), np.zeros(num_pixels, np.uint8)
        cosine, is_frosted = np.ones(num_pixels, np.float32), np.zeros(num_pixels, np.bool_)
        is_frosted_material = glass_surfaces(self.scene.materials).is_frosted

        def inspect_tile(tile: ImageTile) -> int:
            padded, pixel = tile.padded(self.size), tile.pixels(self.size)
            directions = self._directions(padded.pixels(self.size))
            layers = self.trace_layers(directions)
            visible_counts = sum(
                np.bincount(layer.ray[layer.is_visible], minlength=len(directions)) for layer in layers
            )
            num_visible[pixel] = tile.crop_from(padded, np.asarray(visible_counts))
            if smooths:
                tile_edges, tile_cosine = self._find_tile_edges(padded, layers, directions)
                frosted = _shows(self.geometry, layers, is_frosted_material, len(directions))
                is_frosted[pixel] = tile.crop_from(padded, frosted)
                is_edge[pixel], cosine[pixel] = tile.crop_from(padded, tile_edges), tile.crop_from(padded, tile_cosine)
            return sum(len(layer.ray) for layer in layers)

        num_rays = sum(map_ordered(inspect_tile, image_tiles(self.size), MAX_CONCURRENT_TILES))
        is_edge |= is_normal_edge(cosine) | is_frosted
        return EdgePixels(is_edge, is_frosted, int(num_visible[~is_edge].sum(dtype=np.int64)), num_rays)

    def _find_tile_edges(
        self, tile: ImageTile, layers: list[TransparencyLayer], directions: F32
    ) -> tuple[NDArray[np.bool_], F32]:
        """Find edge pixels and the least cosine between neighboring normals, by rays through pixel centers."""
        size = tile.width, tile.height
        is_edge, cosine = np.zeros(len(directions), np.bool_), np.ones(len(directions), np.float32)
        for layer in layers:
            is_layer_edge, layer_cosine = find_edge_pixels(self.geometry, layer, size)
            is_edge |= is_layer_edge
            cosine = np.minimum(cosine, layer_cosine)
            if layer.chain is not None:
                is_edge |= is_radiance_edge(layer, self.scene.environment.radiance, self._edge_threshold, size)
        alpha_test = self.geometry.embree.alpha_test
        if alpha_test is not None and alpha_test.blends:
            start = near_distances(self.camera, directions)
            is_edge |= is_partial_coverage(self.geometry, self._origin, directions, start)
        return is_edge, cosine

    def trace_tile(
        self,
        tile: ImageTile,
        pixels: EdgePixels,
        positions: Shaped[NDArray[np.float64], "n 2"],
    ) -> tuple[MergedRays, int, int]:
        """Trace and merge the rays of a tile.

        Args:
            tile: tile of the image. pixels: edge pixels of the whole image.
            positions: positions of the rays within an edge pixel.
        Returns:
            Merged rays; the number of merged rays in edge pixels; the number of traced rays.
        """
        pixel = tile.pixels(self.size)
        is_edge, is_frosted = pixels.is_edge[pixel], pixels.is_frosted[pixel]
        interior, edges, frosted = pixel[~is_edge], pixel[is_edge & ~is_frosted], pixel[is_frosted]
        interior_layers = self.trace_layers(self._directions(interior))
        edge_layers = self.trace_layers(
            self._directions(edges, positions), _stratified_alpha_samples(edges, len(positions))
        )
        frosted_positions = np.tile(positions, (_FACETS_PER_POSITION, 1))
        frosted_layers = self.trace_layers(
            self._directions(frosted, frosted_positions),
            np.repeat(STOP_AT_OPAQUE, len(frosted) * len(frosted_positions)),
            stratified_facets(frosted, self.size[0], len(frosted_positions)),
        )
        merged_layers = [
            *(merge_rays(self.geometry, layer, edges, positions) for layer in edge_layers),
            *(merge_rays(self.geometry, layer, frosted, frosted_positions) for layer in frosted_layers),
        ]
        num_edge_samples = sum(len(rays.pixel) for rays in merged_layers)
        num_rays = sum(len(layer.ray) for layer in interior_layers + edge_layers + frosted_layers)
        return (
            concatenate_rays(
                [*(unmerged(layer, interior) for layer in interior_layers), *merged_layers], MAX_MIRROR_BOUNCES
            ),
            num_edge_samples,
            num_rays,
        )


def _shows(
    geometry: SceneBuffers, layers: list[TransparencyLayer], is_selected: NDArray[np.bool_], num_rays: int
) -> NDArray[np.bool_]:
    """True for rays that hit one of some materials in any layer. (num_rays,)"""
    out = np.zeros(num_rays, np.bool_)
    if is_selected.any():
        for layer in layers:
            face = layer.hits.face
            out[layer.ray[(face >= 0) & is_selected[geometry.face_material[np.maximum(face, 0)]]]] = True
    return out


def stratified_facets(pixel: NDArray[np.int64], width: int, num: int) -> Shaped[F64, "rays surfaces 2"]:
    """Choose facets of frosted glass for the rays of pixels.

    At the first surface the rays of a pixel are a (0, m, 2)-net, and those of any 4 × 4 pixels are the net of a longer
    Sobol sequence; at the next surfaces they are its further dimensions.

    Args:
        pixel: row-major indices. width: width of the image. num: rays of each pixel, a power of two.
    """
    return sobol_points(pixel, width, num, 2 * _FACETS_PER_RAY).reshape(-1, _FACETS_PER_RAY, 2)


def sobol_points(
    pixel: Shaped[NDArray[np.int64], " p"], width: int, num: int, num_dimensions: int
) -> Shaped[F64, "p num dimensions"]:
    """Return a net of points in [0, 1) for the rays of each pixel; those of any 4 × 4 pixels are one, too.

    Args:
        pixel, width, num: see `stratified_facets`. num_dimensions: of the points.
    """
    from scipy.stats.qmc import Sobol  # half a second to import, and few scenes need it

    side = FROST_PERIOD
    points = Sobol(num_dimensions, scramble=False).random(side**2 * num) + 0.5 / (side**2 * num)
    y, x = np.divmod(pixel, width)
    return np.asarray(points.reshape(side**2, num, num_dimensions)[y % side * side + x % side])


def _stratified_alpha_samples(pixel: NDArray[np.int64], num: int) -> F32:
    """Stratified alpha samples of the rays of p pixels, so that coverage is exact on average. (p · num,)"""
    order = np.array([0, 5, 2, 7, 4, 1, 6, 3])  # decorrelated from the rows of the positions
    return stratum_alpha_samples(pixel, order[order < num], num)


def stratum_alpha_samples(pixel: NDArray[np.int64], strata: NDArray[np.number], num_strata: int) -> F32:
    """Alpha samples of the rays of p pixels, in given strata. (p · n,)

    Args:
        pixel: row-major indices. strata: stratum of each ray, for all pixels (n,) or each (p, n).
        num_strata: their number.
    """
    offset = (pixel[:, None] * _GOLDEN_RATIO_CONJUGATE) % 1  # without it, eighths would be visible as steps
    offset = (np.floor(NUM_OFFSETS * offset) + 0.5) / NUM_OFFSETS
    return np.asarray((strata + offset) / num_strata, np.float32).ravel()
