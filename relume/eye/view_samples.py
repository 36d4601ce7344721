"""View samples: the points of a view whose radiance makes its pixels.

One sample a pixel, more where material, normal or depth change across it (docs/method.md, "View samples"): eight
positions are traced in such a pixel and those that see the same thing, turned alike, are merged into the most central
of them: a silhouette has eight levels of coverage for a few samples, and thin chrome several reflections.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.environments.equirect import lookup
from relume.eye.layers import Layer, layers_of, most_shown
from relume.eye.merged import PATTERNS, POSITIONS_A_PIXEL, Chosen, alone, joined, merged
from relume.eye.mirrors import MOST_MIRRORS
from relume.eye.pixel_edges import bright_edges_of, edges_of, is_partly_there
from relume.eye.tinted import NUM_CHANNELS, has_tinted_glass, parted, sees_tinted_light
from relume.eye.ways import Chain
from relume.scene.model import Camera, Material, Scene
from relume.scene.roughness import level_of, levels_of
from relume.trace.cutout_filter import EVERYWHERE
from relume.trace.geometry import Geometry
from relume.trace.primary import camera_directions
from relume.trace.surface import Surface, surface_at

F32 = NDArray[np.float32]

BACKGROUND = 65_535
EDGES_A_BLOCK = 1 << 17
_SAMPLES_A_SIDE = 2048  # of a pixel's samples, by the root of the number of pixels; a tuft of blades takes 1,600

_GOLDEN = (5**0.5 - 1) / 2


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
        level: of roughness, see `relume.scene.roughness`; 0 where the material has but one. (n,) uint8
        through: what glass before a sample lets through. Samples on glass and those behind it, on mirrors and those
            seen in them, have the same shares of a pixel. Of samples of one channel it is three times that of
            this one, and nothing of others. (n, 3) float32
        eye: where each is seen from: the camera, or the last surface that turned the way to it. (n, 3) float32
        chain: the mirrors that it is seen in, `NO_MIRROR` where it is seen in fewer.
        is_mirrored: whether its surface is a mirror, and other samples have what is seen in it. (n,)
    """

    pixel: NDArray[np.uint32]
    weight: F32
    material: NDArray[np.uint16]
    surface: Surface
    num_rays: int
    level: NDArray[np.uint8]
    through: F32
    eye: F32
    chain: Chain
    is_mirrored: NDArray[np.bool_]

    @property
    def gains(self) -> F32:
        """What the radiance of each sample is multiplied by for its pixel, mirrors apart. (n, 3) float32"""
        return self.weight[:, None] * self.through


def morton(pixel: NDArray[np.int64], width: int) -> NDArray[np.uint64]:
    """Interleave the bits of x and y: the order of a Z-curve.

    Args:
        pixel: row-major numbers. (n,) width: of the picture.
    Returns:
        (n,) uint64
    """
    code = np.zeros(len(pixel), np.uint64)
    x, y = (pixel % width).astype(np.uint64), (pixel // width).astype(np.uint64)
    for bit in range(14):
        one = np.uint64(1)
        code |= ((x >> np.uint64(bit)) & one) << np.uint64(2 * bit)
        code |= ((y >> np.uint64(bit)) & one) << np.uint64(2 * bit + 1)
    return code


def _shared_chances(pixel: NDArray[np.int64], num: int) -> F32:
    """Chances of as many rays of each of p pixels, evenly apart: a surface that blends has its share. (p · num,)"""
    places = np.array([0, 5, 2, 7, 4, 1, 6, 3])  # not in the order of the rows that the positions lie in
    offset = (pixel[:, None] * _GOLDEN) % 1  # eighths alone would be seen as steps
    return np.asarray((places[places < num] + offset) / num + 1e-6, np.float32).ravel()


def thresholds(pixel: NDArray[np.int64], width: int) -> F32:
    """Numbers between 0 and 1 that differ much from pixel to pixel (interleaved gradient noise, Jimenez 2014).

    Args:
        pixel: row-major numbers. (n,) width: of the picture.
    Returns:
        (n,) float32
    """
    y, x = np.divmod(pixel, width)
    return np.asarray((52.9829189 * ((0.06711056 * x + 0.00583715 * y) % 1)) % 1, np.float32)


def _levels(scene: Scene, material: NDArray[np.uint16], roughness: F32, threshold: F32) -> NDArray[np.uint8]:
    """The level of roughness of each sample, by its material. (n,)"""
    level = np.zeros(len(material), np.uint8)
    for index, of_scene in enumerate(scene.materials):
        if ratios := levels_of(of_scene):
            rows = np.flatnonzero(material == index)
            level[rows] = level_of(ratios, roughness[rows], threshold[rows])
    return level


def sample_view(
    scene: Scene,
    geometry: Geometry,
    view: str,
    size: tuple[int, int],
    *,
    follows_mirrors: bool = True,
    smooths_edges: bool = True,
) -> ViewSamples:
    """Find the view samples of one camera.

    Args:
        scene: what is seen. geometry: its triangles.
        view: name of the camera. size: width and height in pixels.
        follows_mirrors: whether what is seen in mirrors has samples.
        smooths_edges: whether pixels across edges have several; else each shows what is seen through its middle.
    """
    width, height = size
    camera = next(camera for camera in scene.cameras if camera.name == view)
    origin, pixel_angle = camera.to_world[:3, 3].astype(np.float32), camera.yfov / height

    def layers(directions: F32, chance: F32 | np.float32) -> list[Layer]:
        return layers_of(
            geometry, scene.materials, origin, directions, chance, pixel_angle, follows_mirrors=follows_mirrors
        )

    y, x = np.divmod(np.arange(width * height), width)
    directions = camera_directions(camera, size, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
    coarse = layers(directions, EVERYWHERE)
    is_edge = np.zeros(width * height, np.bool_)
    if smooths_edges:
        is_edge = _edges(scene, geometry, coarse, origin, directions, size)
    kept = [alone(layer, is_edge) for layer in coarse]
    most = most_samples(scene.materials, width * height)
    across = _Across(geometry, camera, size, layers, np.nonzero(is_edge)[0])
    room, num_rays = most - sum(len(part.pixel) for part in kept), sum(len(layer.ray) for layer in coarse)
    for positions in PATTERNS:
        parts, num_traced = across.seen(positions, room)
        num_rays += num_traced
        if parts is not None:
            kept += parts
            break
    samples = _sorted_samples(scene, geometry, joined(kept, MOST_MIRRORS), width, pixel_angle, num_rays)
    return _by_channel(scene, geometry, samples, most) if has_tinted_glass(scene.materials) else samples


class _Across(NamedTuple):
    """Pixels across edges, which several rays are sent through.

    Attributes:
        geometry: the triangles. camera: that sees them. size: of its picture.
        layers: of rays in some directions, and of their chances.
        pixel: row-major numbers. (p,)
    """

    geometry: Geometry
    camera: Camera
    size: tuple[int, int]
    layers: Callable[[F32, F32], list[Layer]]
    pixel: NDArray[np.int64]

    def seen(self, positions: NDArray[np.float64], room: int) -> tuple[list[Chosen] | None, int]:
        """What is seen through some positions, merged; a block of pixels at a time, as all of them may be edges.

        Args:
            positions: in each pixel. (n, 2) room: for samples; for two of each pixel there must be some.
        Returns:
            Samples of each layer; None where they are more than there is room for. The number of rays traced.
        """
        found: list[list[Chosen]] = []
        num_rays = num_samples = 0
        for start in range(0, max(1, len(self.pixel)), EDGES_A_BLOCK):
            pixel = self.pixel[start : start + EDGES_A_BLOCK]
            y, x = np.divmod(pixel, self.size[0])
            at_x, at_y = ((a[:, None] + positions[:, k]).astype(np.float32).ravel() for k, a in enumerate((x, y)))
            directions = camera_directions(self.camera, self.size, at_x, at_y)
            fine = self.layers(directions, _shared_chances(pixel, len(positions)))
            found.append([merged(self.geometry, layer, pixel, positions) for layer in fine])
            num_rays += sum(len(layer.ray) for layer in fine)
            num_samples += sum(len(part.pixel) for part in found[-1])
            if num_samples > room:
                return None, num_rays
        return [part for of_layer in zip_longest(*found) for part in of_layer if part is not None], num_rays


def most_samples(materials: Sequence[Material], num_pixels: int) -> int:
    """Bound the samples of a view: each position of a pixel sees something else, glass before it, more in mirrors.

    Edges are lines: twice as many pixels a side are twice as many edges among four times as many pixels. So a large
    picture has room for fewer samples of each pixel; where leaves or hair would take more, edges have fewer positions.

    Args:
        materials: of the scene. num_pixels: of the picture.
    """
    a_pixel = min(max(_SAMPLES_A_SIDE / math.sqrt(num_pixels), len(PATTERNS[-1])), POSITIONS_A_PIXEL)
    return math.ceil(a_pixel * num_pixels) * most_shown(materials)


def _edges(
    scene: Scene, geometry: Geometry, layers: list[Layer], origin: F32, directions: F32, size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Find the pixels that want more rays than the one through their middle. (pixels,)

    Args:
        layers: of those rays. origin: of them. (3,) directions: of them. (pixels, 3). size: of the picture, pixels.
    """
    is_edge = np.any([edges_of(geometry, layer, size) for layer in layers], axis=0)
    for layer in layers:
        if layer.chain is not None:
            is_edge |= bright_edges_of(layer, scene.environment.radiance, size)
    if geometry.embree.holes is not None and geometry.embree.holes.blends:
        is_edge |= is_partly_there(geometry, origin, directions)
    return np.asarray(is_edge)


def _sorted_samples(
    scene: Scene, geometry: Geometry, chosen: Chosen, width: int, pixel_angle: float, num_rays: int
) -> ViewSamples:
    """Make samples of rays. width: of the picture. pixel_angle: that a pixel spans. num_rays: that were traced."""
    hit = chosen.seen.hits.face >= 0
    face = np.maximum(chosen.seen.hits.face, 0)
    material = np.where(hit, geometry.face_material[face], BACKGROUND).astype(np.uint16)
    order = np.lexsort((morton(chosen.pixel, width), material))
    seen = chosen.seen.rows(order)
    full = surface_at(geometry, seen.hits, seen.directions, scene.materials, pixel_angle)
    level = _levels(scene, material[order], full.roughness, thresholds(chosen.pixel[order], width))
    if level.any():
        by_level = np.lexsort((level, material[order]))
        order, full, seen, level = order[by_level], full.rows(by_level), seen.rows(by_level), level[by_level]
    outside = ~hit[order]
    full.diffuse[outside] = lookup(scene.environment.radiance, seen.directions[outside])
    assert seen.chain is not None
    return ViewSamples(
        chosen.pixel[order].astype(np.uint32), chosen.weight[order], material[order], full, num_rays, level,
        seen.through, seen.eyes, seen.chain, seen.is_mirrored,
    )  # fmt: skip


def _by_channel(scene: Scene, geometry: Geometry, samples: ViewSamples, most: int) -> ViewSamples:
    """Make samples of one channel of those that light reaches through tinted glass; none where that were too many.

    most: samples that a plan has room for.
    """
    num, num_surface = len(samples.pixel), int(np.searchsorted(samples.material, BACKGROUND))
    of_surface, is_lit = samples.surface.points.rows(slice(0, num_surface)), np.zeros(num, np.bool_)
    is_lit[:num_surface], num_rays = sees_tinted_light(geometry, of_surface, scene.environment.radiance)
    if num + (NUM_CHANNELS - 1) * np.count_nonzero(is_lit) > most:
        return replace(samples, num_rays=samples.num_rays + num_rays)
    rows, shown = parted(is_lit)
    level, material = samples.level[rows], samples.material[rows]
    order = np.lexsort((shown.argmax(axis=1), level, material))  # neighbours of one channel follow each other
    rows, shown = rows[order], shown[order]
    return ViewSamples(
        samples.pixel[rows], samples.weight[rows] / shown.max(axis=1), samples.material[rows],
        samples.surface.rows(rows), samples.num_rays + num_rays, samples.level[rows], samples.through[rows] * shown,
        samples.eye[rows], samples.chain.rows(rows), samples.is_mirrored[rows],
    )  # fmt: skip
