"""View samples of a camera with a lens (`relume.scene.lens`): rays from points of the aperture, merged if in focus.

A pixel has more rays the larger the circles of confusion of its surfaces are; a few rays of their own find these, so
that the number does not depend on the rays that count. Rays whose circle of confusion is smaller than a pixel hit one
spot of a surface, and are merged like those of an edge; every other ray becomes a sample.

The rays of a pixel are a block of a Sobol sequence over lens, pixel, alpha samples and facets of frosted glass; the
blocks of 4 × 4 pixels are together a net of it, so that noise is fine. Other 4 × 4 pixels have it shifted.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from relume.camera.camera_samples import CameraSetup, sobol_points, stratum_alpha_samples
from relume.camera.merge_rays import MergedRays, concatenate_rays, merge_rays
from relume.camera.refraction import has_frost
from relume.camera.specular_hits import MAX_MIRROR_BOUNCES
from relume.camera.tiling import ImageTile
from relume.camera.transparency_layers import TransparencyLayer
from relume.raytrace.camera_rays import camera_directions
from relume.scene.lens import Lens
from relume.scene.model import Camera

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

TILE_SIZE = 64  # pixels: as many rays as a larger tile of a camera without a lens has
RAYS_PER_PIXEL = (64, 32, 16, 8, 4, 2)  # most rays; fewer if the samples of an image are too many
PILOT_RAYS = 8
_RAYS_PER_BLUR = 8  # rays for each pixel of the diameter of the circle of confusion
_MAX_VIEW_ANGLE = math.radians(2.0)  # of merged rays at their hit: highlights change with the view direction
_MAX_CELLS_PER_SIDE = 16
_LENS, _PIXEL, _ALPHA, _FACETS = slice(0, 2), slice(2, 4), 4, slice(5, 13)  # dimensions of the sequence
_NUM_DIMENSIONS = 13
_SHIFT_PERIOD = 64  # blocks, after which shifts repeat
_PILOT_SEED, _SEED = 1, 2


class _LensRays(NamedTuple):
    """Rays through the lens, grouped by pixel.

    Attributes:
        positions: position in the pixel and point of the lens, both in [0, 1). (pixels, n, 4)
        origins, directions: in world space. (rays, 3)
        camera_cosine: of each ray and the axis of the camera. (rays,)
    """

    positions: F64
    origins: F32
    directions: F32
    camera_cosine: F64
    alpha_sample: F32
    facets: F64 | None


def trace_lens_tile(setup: CameraSetup, tile: ImageTile, max_rays: int) -> tuple[MergedRays, int, int]:
    """Trace and merge the rays of a tile.

    Args:
        setup: a camera with a lens. tile: tile of its image. max_rays: maximum number of rays of a pixel.
    Returns:
        Merged rays; their number; the number of traced rays.
    """
    padded, pixel = tile.padded(setup.size), tile.pixels(setup.size)
    blur, num_traced = _find_blur(setup, padded.pixels(setup.size))
    largest_blur = maximum_filter(blur.reshape(padded.height, padded.width), 3).ravel()
    num_rays = _rays_per_pixel(np.asarray(tile.crop_from(padded, largest_blur), np.float64), max_rays)
    groups = list[MergedRays]()
    for num in np.unique(num_rays).tolist():
        pixels = pixel[num_rays == num]
        rays = _lens_rays(setup, pixels, num, _SEED)
        for layer in _trace(setup, rays):
            groups += _merge_in_focus(setup, rays, layer, pixels)
            num_traced += len(layer.ray)
    merged = concatenate_rays(groups, MAX_MIRROR_BOUNCES)
    return merged, len(merged.pixel), num_traced


def _lens(camera: Camera) -> Lens:
    assert camera.lens is not None
    return camera.lens


def _find_blur(setup: CameraSetup, pixel: NDArray[np.int64]) -> tuple[F64, int]:
    """Find the largest circle of confusion in each pixel that shows a surface, in pixels; and count the rays."""
    rays = _lens_rays(setup, pixel, PILOT_RAYS, _PILOT_SEED)
    layers = _trace(setup, rays)
    blur, shows_surface = np.zeros(len(pixel)), np.zeros(len(pixel), np.bool_)
    for layer in layers:
        np.maximum.at(blur, layer.ray // PILOT_RAYS, _blur_of_hits(setup, rays, layer))
        shows_surface[layer.ray[layer.hits.face >= 0] // PILOT_RAYS] = True
    return np.where(shows_surface, blur, 0), sum(len(layer.ray) for layer in layers)


def _blur_of_hits(setup: CameraSetup, rays: _LensRays, layer: TransparencyLayer) -> F64:
    """Diameter of the circle of confusion of each hit, in pixels; paths over mirrors and glass count by their length.

    (rays of the layer,)
    """
    depth = layer.hits.distance * rays.camera_cosine[layer.ray]
    pixels_per_slope = setup.size[1] / (2 * math.tan(setup.camera.yfov / 2))
    return _lens(setup.camera).circle_of_confusion(np.maximum(depth, 1e-9)) * pixels_per_slope


def _rays_per_pixel(blur: F64, max_rays: int) -> NDArray[np.int64]:
    """Number of rays of each pixel, a power of two."""
    exponent = np.ceil(np.log2(np.clip(_RAYS_PER_BLUR * blur, PILOT_RAYS, RAYS_PER_PIXEL[0])))
    return np.minimum(2 ** exponent.astype(np.int64), max_rays)


def _lens_rays(setup: CameraSetup, pixel: NDArray[np.int64], num: int, seed: int) -> _LensRays:
    """Choose `num` rays in each of `pixel`."""
    camera, width = setup.camera, setup.size[0]
    y, x = np.divmod(pixel, width)
    points = sobol_points(pixel, width, num, _NUM_DIMENSIONS)
    shifts = np.random.default_rng(seed).random((_SHIFT_PERIOD, _SHIFT_PERIOD, 1, _NUM_DIMENSIONS))
    points = (points + shifts[y // 4 % _SHIFT_PERIOD, x // 4 % _SHIFT_PERIOD]) % 1
    flat = points.reshape(-1, _NUM_DIMENSIONS)
    at_x, at_y = ((a[:, None] + points[..., k]).astype(np.float32).ravel() for a, k in ((x, 2), (y, 3)))
    from_center = camera_directions(camera, setup.size, at_x, at_y).astype(np.float64)
    right_up = _lens(camera).points(flat[:, _LENS])
    offsets = right_up @ camera.to_world[:3, :2].T
    to_focus = from_center * (_lens(camera).focus_distance / -(from_center @ camera.to_world[:3, 2]))[:, None]
    directions = to_focus - offsets
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return _LensRays(
        np.concatenate([points[..., _PIXEL], points[..., _LENS]], axis=2),
        (camera.to_world[:3, 3] + offsets).astype(np.float32),
        directions.astype(np.float32),
        -(directions @ camera.to_world[:3, 2]),
        stratum_alpha_samples(pixel, np.floor(8 * points[..., _ALPHA]), 8),
        flat[:, _FACETS].reshape(len(flat), -1, 2) if has_frost(setup.scene.materials) else None,
    )


def _trace(setup: CameraSetup, rays: _LensRays) -> list[TransparencyLayer]:
    return setup.trace_layers(rays.directions, rays.alpha_sample, rays.facets, rays.origins)


def _merge_in_focus(
    setup: CameraSetup, rays: _LensRays, layer: TransparencyLayer, pixels: NDArray[np.int64]
) -> list[MergedRays]:
    """Merge the rays of a layer that are in focus; the others become samples of their own."""
    num = rays.positions.shape[1]
    is_sharp = _blur_of_hits(setup, rays, layer) < 1
    blurred = layer.rows(~is_sharp).visible
    alone = MergedRays(pixels[blurred.ray // num], np.full(len(blurred.ray), 1 / num, np.float32), blurred)
    sharp = layer.rows(is_sharp)
    per_side = _cells_per_side(_lens(setup.camera))
    cell = np.floor(rays.positions[..., 2:].reshape(-1, 2)[sharp.ray] * per_side).astype(np.int64) @ (per_side, 1)
    sharp = sharp._replace(key=(sharp.key + 1) * per_side**2 + cell - 1)
    return [alone, merge_rays(setup.geometry, sharp, pixels, rays.positions)]


def _cells_per_side(lens: Lens) -> int:
    """Cells of the lens along each axis, within which rays are merged."""
    return min(_MAX_CELLS_PER_SIDE, math.ceil(2 * lens.radius / lens.focus_distance / _MAX_VIEW_ANGLE))
