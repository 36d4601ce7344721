"""View samples: the points of a view whose radiance makes its pixels.

One sample a pixel, more where material, normal or depth change across it (docs/method.md, "View samples"): eight
positions are traced in such a pixel and those that see the same thing, turned alike, are merged into the most central
of them: a silhouette has eight levels of coverage for a few samples, and thin chrome several reflections.

A picture is looked at twice, window by window: for edges, then for samples, which go to files as they are found and are
read from there in their order (docs/adr/0105-samples-window-by-window.md).
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from relume.environments.equirect import lookup
from relume.eye.layers import most_shown
from relume.eye.merged import PATTERNS, POSITIONS_A_PIXEL, Chosen
from relume.eye.seen import Edges, Eye
from relume.eye.sorted_rows import Column, SortedRows
from relume.eye.tinted import POINTS_A_BLOCK, Split, SplitColumn, TintedLight, num_tints
from relume.eye.ways import Chain
from relume.eye.windows import AT_ONCE, Window, morton, windows_of
from relume.parallel import each_in_order
from relume.points import Points
from relume.scene.model import Material, Scene
from relume.scene.roughness import level_of, levels_of
from relume.trace.geometry import Geometry
from relume.trace.surface import Surface, surface_at

F32 = NDArray[np.float32]

BACKGROUND = 65_535
_SAMPLES_A_SIDE = 2048  # of a pixel's samples, by the root of the number of pixels; a tuft of blades takes 1,600
_LEVELS = 256


_POINTS = ("position", "normal", "tangent")
_SURFACE = ("diffuse", "specular", "uv", "roughness", "normal_length", "emission", "surface_normal")
_CHAIN = ("mirror", "mirror_cosine", "mirror_tint")
_OWN = ("pixel", "weight", "material", "level", "through", "eye", "is_mirrored", "chance")
_COLUMNS = (*_OWN, *_POINTS, *_SURFACE, *_CHAIN)
_NEEDED = ("material", "level", "position", "normal")  # to tell which samples light comes to through tinted glass


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
            seen in them, have the same shares of a pixel. Where light comes to a sample through tinted glass, several
            stand in its place, which share its `weight`, and this says how (`relume.eye.tinted`). (n, 3) float32
        eye: where each is seen from: the camera, or the last surface that turned the way to it. (n, 3) float32
        chain: the mirrors that it is seen in, `NO_MIRROR` where it is seen in fewer.
        is_mirrored: whether its surface is a mirror, and other samples have what is seen in it. (n,)
        chance: of its rays at surfaces that blend, see `relume.points.Points`. (n,) float32
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
    chance: F32

    @classmethod
    def of(cls, columns: Mapping[str, Any], num_rays: int) -> ViewSamples:
        """Those of columns as `sampled` names them, which are read. num_rays: that were traced."""
        read = {name: np.asarray(columns[name]) for name in _COLUMNS}
        seed = np.arange(len(read["pixel"]), dtype=np.uint32)
        points = Points(seed=seed, **{name: read[name] for name in _POINTS})
        return cls(
            surface=Surface(points, **{name: read[name] for name in _SURFACE}),
            chain=Chain(*(read[name] for name in _CHAIN)),
            num_rays=num_rays,
            **{name: read[name] for name in _OWN},
        )

    @property
    def gains(self) -> F32:
        """What the radiance of each sample is multiplied by for its pixel, mirrors apart. (n, 3) float32"""
        return self.weight[:, None] * self.through


def thresholds(pixel: NDArray[np.int64], width: int) -> F32:
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
    geometry: Geometry,
    view: str,
    size: tuple[int, int],
    *,
    follows_mirrors: bool = True,
    smooths_edges: bool = True,
    by_channel: bool = False,
) -> ViewSamples:
    """Find the view samples of one camera, in memory.

    Args:
        scene: what is seen. geometry: its triangles.
        view: name of the camera. size: width and height in pixels.
        follows_mirrors: whether what is seen in mirrors has samples.
        smooths_edges: whether pixels across edges have several; else each shows what is seen through its middle.
        by_channel: whether samples that see light through tinted glass are split by channel, not by tint.
    """
    eye = eye_of(scene, geometry, view, size, follows_mirrors=follows_mirrors)
    return ViewSamples.of(*sampled(eye, io.BytesIO, smooths_edges=smooths_edges, by_channel=by_channel))


def eye_of(scene: Scene, geometry: Geometry, view: str, size: tuple[int, int], *, follows_mirrors: bool = True) -> Eye:
    """The eye of a view. See `sample_view`."""
    camera = next(camera for camera in scene.cameras if camera.name == view)
    return Eye(scene, geometry, camera, size, follows_mirrors)


def sampled(
    eye: Eye,
    scratch: Callable[[], IO[bytes]],
    names: Sequence[str] = _COLUMNS,
    *,
    smooths_edges: bool = True,
    by_channel: bool = False,
) -> tuple[dict[str, Column], int]:
    """Find the view samples of an eye, of which no more than a window's are in memory.

    Args:
        eye: that sees them. scratch: opens a file that is gone when it is closed.
        names: of the columns that are wanted. smooths_edges, by_channel: see `sample_view`.
    Returns:
        The columns of `ViewSamples`, of its surface, points and chain, by name; how many rays were traced.
    """
    edges, size, materials = eye.edges(smooths=smooths_edges), eye.size, eye.scene.materials
    num_rays, most = edges.num_rays, most_samples(materials, size[0] * size[1])
    for positions in PATTERNS:
        rows, num_traced = _rows(eye, edges, positions, most, scratch, {*names, *_NEEDED})
        num_rays += num_traced
        if rows is not None:
            break
    assert rows is not None  # for two samples of each pixel there is room
    columns = rows.columns()
    if num_tints(materials):
        split, num_traced = _split(eye, columns, most, by_channel=by_channel)
        columns, num_rays = {**columns, **split}, num_rays + num_traced
    return {name: columns[name] for name in names}, num_rays


def _rows(
    eye: Eye,
    edges: Edges,
    positions: NDArray[np.float64],
    most: int,
    scratch: Callable[[], IO[bytes]],
    names: Collection[str],
) -> tuple[SortedRows | None, int]:
    """Find samples window by window.

    Args:
        eye: that sees them. edges: of its picture. positions: of the rays in each pixel across edges. (n, 2)
        most: samples that there is room for. scratch, names: see `sampled`.
    Returns:
        None where they are more than there is room for; how many rays were traced.
    """
    rows, num_samples, num_rays = SortedRows(scratch), edges.num_alone, 0

    def found(window: Window) -> tuple[dict[str, NDArray[Any]], int, int]:
        chosen, num_fine, num_traced = eye.chosen(window, edges.is_edge, positions)
        return _sorted_samples(eye, chosen), num_fine, num_traced

    for columns, num_fine, num_traced in each_in_order(found, windows_of(eye.size), AT_ONCE):
        num_samples, num_rays = num_samples + num_fine, num_rays + num_traced
        if num_samples > most:
            return None, num_rays
        rows.add(_key(columns["material"], columns["level"]), {name: columns[name] for name in names})
    return rows, num_rays


def most_samples(materials: Sequence[Material], num_pixels: int) -> int:
    """Bound the samples of a view: each position of a pixel sees something else, glass before it, more in mirrors.

    Edges are lines: twice as many pixels a side are twice as many edges among four times as many pixels. So a large
    picture has room for fewer samples of each pixel; where leaves or hair would take more, edges have fewer positions.

    Args:
        materials: of the scene. num_pixels: of the picture.
    """
    a_pixel = min(max(_SAMPLES_A_SIDE / math.sqrt(num_pixels), len(PATTERNS[-1])), POSITIONS_A_PIXEL)
    return math.ceil(a_pixel * num_pixels) * most_shown(materials)


def _key(material: NDArray[np.uint16], level: NDArray[np.uint8]) -> NDArray[np.int32]:
    """What samples are sorted by, before their places in the picture. (n,)"""
    return material.astype(np.int32) * _LEVELS + level


def _levels(scene: Scene, material: NDArray[np.uint16], roughness: F32, threshold: F32) -> NDArray[np.uint8]:
    """The level of roughness of each sample, by its material. (n,)"""
    level = np.zeros(len(material), np.uint8)
    for index, of_scene in enumerate(scene.materials):
        if ratios := levels_of(of_scene):
            rows = np.flatnonzero(material == index)
            level[rows] = level_of(ratios, roughness[rows], threshold[rows])
    return level


def _sorted_samples(eye: Eye, chosen: Chosen) -> dict[str, NDArray[Any]]:
    """Make samples of rays. Returns columns by name, sorted as `ViewSamples` are."""
    scene, geometry, width = eye.scene, eye.geometry, eye.size[0]
    hit = chosen.seen.hits.face >= 0
    face = np.maximum(chosen.seen.hits.face, 0)
    material = np.where(hit, geometry.face_material[face], BACKGROUND).astype(np.uint16)
    order = np.lexsort((morton(chosen.pixel, width), material))
    seen = chosen.seen.rows(order)
    full = surface_at(geometry, seen.hits, seen.directions, scene.materials, eye.pixel_angle)
    level = _levels(scene, material[order], full.roughness, thresholds(chosen.pixel[order], width))
    if level.any():
        by_level = np.lexsort((level, material[order]))
        order, full, seen, level = order[by_level], full.rows(by_level), seen.rows(by_level), level[by_level]
    outside = ~hit[order]
    full.diffuse[outside] = lookup(scene.environment.radiance, seen.directions[outside])
    assert seen.chain is not None
    return {
        "pixel": chosen.pixel[order].astype(np.uint32), "weight": chosen.weight[order], "material": material[order],
        "level": level, "through": seen.through, "eye": seen.eyes, "is_mirrored": seen.is_mirrored,
        "chance": np.zeros(len(order), np.float32),
        **{name: getattr(full.points, name) for name in _POINTS},
        **{name: getattr(full, name) for name in _SURFACE},
        **dict(zip(_CHAIN, seen.chain, strict=True)),
    }  # fmt: skip


def _split(
    eye: Eye, columns: Mapping[str, Column], most: int, *, by_channel: bool
) -> tuple[dict[str, Any], int]:
    """Split samples that light reaches through tinted glass; none where they were too many.

    Args:
        eye: that sees the samples. columns: of them. most: samples that a plan has room for.
        by_channel: see `sample_view`.
    Returns:
        Columns in place of those; how many rays were traced.
    """
    key = _key(np.asarray(columns["material"]), np.asarray(columns["level"]))
    num, num_surface = len(key), int(np.searchsorted(key, BACKGROUND * _LEVELS))
    light = TintedLight(eye.geometry, eye.scene.environment.radiance)
    tints, num_rays = np.full((num, light.num_groups, 3), np.nan, np.float32), 0
    for start in range(0, num_surface, POINTS_A_BLOCK):
        block = slice(start, min(start + POINTS_A_BLOCK, num_surface))
        tints[block], num_traced = light.tints(columns["position"][block], columns["normal"][block])
        num_rays += num_traced
    split = Split(tints, np.append(np.flatnonzero(np.diff(key, prepend=-1)), num), by_channel=by_channel)
    if len(split.row) > most:
        return {}, num_rays
    return {name: SplitColumn(name, column, split) for name, column in columns.items()}, num_rays
