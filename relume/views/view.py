"""A baked view opened for rendering: its samples by material, and their weights in pixels."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.roughness_levels import RoughnessLevels
from relume.brdf.texture_slots import EmissionImage
from relume.camera.view_samples import BACKGROUND
from relume.core.cache import Cache
from relume.core.errors import ChunkDamagedError, StoreError
from relume.images.image_store import load_emission_image, load_texture
from relume.math.uv_transform import UvTransform
from relume.patches.hit_distance import mean_inverse_distance
from relume.patches.neighbor_filter import NeighborFilter
from relume.raytrace.gather_rays import RayPattern
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.texture import sample_image
from relume.scene.model import Camera
from relume.store.bake_protocol import StoreReader
from relume.store.optional_arrays import read_optional
from relume.transport.outgoing_patch_light import no_light
from relume.transport.shading_points import GatherRays, ShadingPoints
from relume.views.frost_filter import REACH, FrostFilter, make_frost_filter
from relume.views.mirror_samples import MirrorSamples, read_mirror_samples
from relume.views.store_io import (
    RayTracing,
    TransferReader,
    make_material_pattern,
    read_camera,
    read_level_pairs,
    read_ray_origins,
    read_roughness_levels,
    read_rows_by_block,
    read_seeds,
    read_shortest_normals,
    read_surface_points,
    read_uv,
    view_directions,
)

F32 = NDArray[np.float32]
Tile = tuple[int, int, int, int]

TILE_PIXELS = 64
_TEXTURE_NAMES = ("diffuse", "specular")


@dataclass(frozen=True)
class View:
    """One camera's samples, sorted by material.

    Attributes:
        bounds: samples of material k are [bounds[k], bounds[k + 1]); after the last material, background.
        key: key of the bake in `cache`.
        first: samples of pixel p are `order[first[p] : first[p + 1]]`.
        throughput: factor of each sample's radiance in its pixel, in `order`: weight times transmittance of glass; zero
            for samples in mirrors, because the look decides their reflectance. One channel, or 3 with glass or mirrors.
        origin: origins of the camera rays to surface samples; one each, or one for all.
        mirrored: samples in mirrors; None if there are none.
        is_mirrored: surface samples on mirrors whose reflection is in other samples.
        textures: textures of each material, the scene's textures that are not 1 everywhere, by name. (n, 3)
        level: roughness levels, ascending within a material. level_pairs: of each material, see `RoughnessLevels`.
        frost: filter of the samples behind frosted glass; None without any.
        maps: overridden maps of each material, see `relume.views.map_override`; empty if there are none.
        baked_rows: row of each surface sample in baked order; None: in that order.
        overridden: views of the same samples by overridden maps, as long as an image uses them.
    """

    camera: Camera
    index: int
    width: int
    height: int
    store: StoreReader = field(repr=False)
    cache: Cache = field(repr=False)
    key: str
    bounds: Shaped[NDArray[np.int64], " bounds"]
    pixel: Shaped[NDArray[np.uint32], " n"]
    first: Shaped[NDArray[np.int32], " first"]
    order: Shaped[NDArray[np.int32], " n"]
    throughput: Shaped[F32, "n channels"]
    origin: Shaped[F32, "#surface_samples 3"]
    mirrored: MirrorSamples | None
    is_mirrored: Shaped[NDArray[np.bool_], " surface_samples"]
    textures: Sequence[Mapping[str, F32]]
    level: Shaped[NDArray[np.uint8], " surface_samples"]
    level_pairs: tuple[tuple[tuple[float, float], ...], ...]
    frost: FrostFilter | None = None
    maps: tuple[Hashable | None, ...] = ()
    baked_rows: Shaped[NDArray[np.int64], " surface_samples"] | None = field(default=None, repr=False)
    overridden: WeakValueDictionary[tuple[Hashable | None, ...], View] = field(
        default_factory=WeakValueDictionary, repr=False
    )

    def sample_key(self, material: int) -> tuple[Hashable, ...]:
        """Cache key of a material's samples: with its overridden maps, if any."""
        return self.name, material, *filter(None, self.maps[material : material + 1])

    def unmodified(self) -> Shaped[NDArray[np.int64], " surface_samples"]:
        """Row of each surface sample in baked order."""
        return np.arange(self.num_surface_samples) if self.baked_rows is None else self.baked_rows

    @property
    def name(self) -> str:
        """The name of its camera."""
        return self.camera.name

    @property
    def num_view_samples(self) -> int:
        """The number of samples, background included."""
        return len(self.pixel)

    @property
    def num_surface_samples(self) -> int:
        """The number of samples on surfaces, which come first."""
        return int(self.bounds[-1])

    def rows(self, material: int) -> slice:
        """Rows of a material's samples."""
        return slice(int(self.bounds[material]), int(self.bounds[material + 1]))

    def is_in_region(self, material: int, region: Tile) -> Shaped[NDArray[np.bool_], " n"]:
        """True for a material's samples in pixels of a region: x, y, width, height."""
        row, column = np.divmod(self.pixel[self.rows(material)].astype(np.int64), self.width)
        (x, y, width, height), reach = region, self._reach
        is_in_columns = (column >= x - reach) & (column < x + width + reach)
        return is_in_columns & (row >= y - reach) & (row < y + height + reach)

    @property
    def _reach(self) -> int:
        """Pixels to each side of its own that a sample contributes to."""
        return 0 if self.frost is None else REACH

    def has_normal_map(self, material: int) -> bool:
        """True if a material's normals are of a map, the scene's or a look's."""
        return any(self.maps[material : material + 1]) or read_shortest_normals(self.store)[material] < 1

    def roughness_levels(self, material: int) -> RoughnessLevels:
        """Roughness levels of a material's samples."""
        return RoughnessLevels(self.level_pairs[material], self.level[self.rows(material)])

    def image(self, material: int, name: str, uv: UvTransform | None = None) -> Shaped[F32, "n 3"]:
        """Look up an image of a look at a material's samples.

        Args:
            material: its index. name: "image:<id>". uv: transform of its texture coordinates; None: as they are.
        Raises:
            StoreError: the store has no texture coordinates. NotFoundError, SceneError: the image cannot be loaded.
        """

        def sample() -> F32:
            coordinates = self._uv(self.rows(material))
            return sample_image(load_texture(name), coordinates if uv is None else uv.footprints(coordinates))

        return self.cache.get_value((self.key, "image", *self.sample_key(material), name, uv), sample)

    def _uv(self, rows: slice) -> Shaped[F32, "n uv"]:
        uv = read_uv(self.store, self.index, rows.start, rows.stop)
        if uv is None:
            raise StoreError("this bake is too old for uploaded images; bake the scene again")
        return uv

    def emissive(self, material: int, image: EmissionImage | None = None) -> Shaped[F32, "n channels"]:
        """Return the emission of a material's samples over its mean; 3 channels with emission images, else 1.

        Args:
            material: its index. image: emitted image of a look; None: the scene's own.
        Raises:
            NotFoundError, SceneError: the image cannot be loaded. StoreError: as `image`.
        """
        rows = self.rows(material)
        if image is not None:
            return sample_image(load_emission_image(image), self._uv(rows))
        if not self.store.attributes.get("has_emission_images"):
            return np.ones((rows.stop - rows.start, 1), np.float32)
        return np.asarray(self.store.read(f"views/{self.index}/emission", rows.start, rows.stop), np.float32)

    def ray_origins(self, rows: slice) -> Shaped[F32, "n 3"]:
        """Origins of camera rays to surface samples; one each, or one for all."""
        return self.origin if len(self.origin) == 1 else self.origin[rows]

    def surface_points(self, material: int) -> SurfacePoints:
        """Read a material's samples from the store as points."""
        return self._read_surface_points(self.rows(material))

    def all_surface_points(self) -> SurfacePoints:
        """Read all samples on surfaces from the store as points, material after material."""
        return self._read_surface_points(slice(0, self.num_surface_samples))

    def _read_surface_points(self, rows: slice) -> SurfacePoints:
        seed = read_seeds(self.store, self.index, rows.start, rows.stop)
        return read_surface_points(self.store, self.index, rows.start, rows.stop, seed)

    def cos_theta_o(self, material: int) -> Shaped[NDArray[np.float64], " n"]:
        """Read the cosines between a material's normals and view directions, zero at back faces."""
        unlit = self._read_unlit(material)
        return np.asarray(np.einsum("nc,nc->n", unlit.normal, unlit.wo.astype(np.float64)).clip(0, 1))

    def normals(self, material: int) -> Shaped[F32, "n 3"]:
        """Read the normals of a material's samples."""
        return self._read_unlit(material).normal

    def receivers(self, material: int, *, is_lit: bool = True) -> ShadingPoints:
        """Read a material's samples from the store as shading points, without rays.

        Args:
            material: its index. is_lit: the environment emits light; else no visibility is read.
        """
        unlit = self._read_unlit(material)
        return replace(unlit, visible=self._read_visibility(material)) if is_lit else unlit

    def _read_unlit(self, material: int) -> ShadingPoints:
        """Read a material's samples without visibility, cached because previews need them in each frame."""
        key = self.key, "receivers", *self.sample_key(material)
        return self.cache.transient.get_value(key, lambda: self._make_unlit(material))

    def _make_unlit(self, material: int) -> ShadingPoints:
        rows = self.rows(material)
        surface_points = self.surface_points(material)
        read = partial(read_uv, self.store, self.index, rows.start, rows.stop)
        cached_uv = partial(self.cache.transient.get_value, (self.key, "uv", *self.sample_key(material)), read)
        level = self.level[rows] if self.level_pairs[material] else None
        wo = view_directions(self.ray_origins(rows), surface_points.position)
        return ShadingPoints(surface_points, wo, np.empty((len(wo), 0), np.uint8), (), cached_uv, level)

    def _read_visibility(self, material: int) -> NDArray[np.uint8]:
        """Read the visibility of a material's samples, cached because decompression is slow."""
        rows = self.rows(material)

        def read() -> NDArray[np.uint8]:
            return self.store.read(f"views/{self.index}/visibility", rows.start, rows.stop)

        return self.cache.transient.get_value(self._visibility_key(material), read)

    def _visibility_key(self, material: int) -> tuple[Hashable, ...]:
        return self.key, "visibility", *self.sample_key(material)

    def read_rows(
        self, name: str, material: int, sample_indices: Shaped[NDArray[np.integer], " k"]
    ) -> Shaped[NDArray[Any], "k ..."]:
        """Read an array of the view at some of a material's samples; if rays must be traced, only for those.

        Args:
            name: name of the array. material: its index.
            sample_indices: ascending, counted from the material's first.
        """
        rows, path = self.rows(material), f"views/{self.index}/{name}"
        if isinstance(self.store, TransferReader):
            return np.asarray(self.store.read_rows(path, rows.start + sample_indices))
        if name == "visibility" and self.cache.contains(self._visibility_key(material)):
            return np.asarray(self._read_visibility(material)[sample_indices])
        return read_rows_by_block(self.store, path, rows.start + sample_indices)

    def subset_rays(self, material: int, sample_indices: Shaped[NDArray[np.integer], " k"]) -> GatherRays:
        """Read gather rays of some of a material's samples, unfiltered and without light. See `read_rows`."""
        pattern = make_material_pattern(self.store, self.index, material)
        gather_hits = self.read_rows("gather_hits", material, sample_indices)[:, : pattern.num_rays]
        return GatherRays(np.ascontiguousarray(gather_hits, np.uint16), pattern, no_light())

    def gather_rays(self, material: int) -> GatherRays:
        """Read the gather rays of a material's samples without light, with the filter between neighbors."""
        rows = self.rows(material)
        pattern = make_material_pattern(self.store, self.index, material)
        stored_hits = self.store.read(f"views/{self.index}/gather_hits", rows.start, rows.stop)
        gather_hits = np.ascontiguousarray(stored_hits[:, : pattern.num_rays])  # others may have more rays
        return GatherRays(gather_hits, pattern, no_light(), self._neighbor_filter(material, gather_hits, pattern))

    def mirror_lights(self, material: int) -> Shaped[NDArray[np.uint8], "n bytes"]:
        """Read the virtual lights in planar mirrors that a material's samples see, as bits."""
        rows = self.rows(material)

        def read() -> NDArray[np.uint8]:
            return np.asarray(self.store.read(f"views/{self.index}/mirror_lights", rows.start, rows.stop), np.uint8)

        return self.cache.transient.get_value((self.key, "mirror lights", *self.sample_key(material)), read)

    def trace_gather_rays(self, material: int, is_canceled: Callable[[], bool]) -> None:
        """Trace gather rays that were not baked, because of an overridden normal map; reading them is then immediate.

        Args:
            material: its index. is_canceled: called regularly.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        if isinstance(self.store, RayTracing):
            self.store.trace_gather_rays(self.rows(material).start, is_canceled)

    def _neighbor_filter(
        self, material: int, gather_hits: Shaped[NDArray[np.uint16], "n rays"], pattern: RayPattern
    ) -> NeighborFilter:
        def build_filter() -> NeighborFilter:
            points, patch_position = self.surface_points(material), read_optional(self.store, "patches/position")
            if patch_position is None:  # not known: the filter depends on normals alone
                inverse_distance = np.zeros(points.num_points, np.float32)
            else:
                cosine_hits = gather_hits[:, : pattern.num_cosine]
                inverse_distance = mean_inverse_distance(points.position, cosine_hits, patch_position)
            return NeighborFilter.of_samples(self.pixel[self.rows(material)], self.width, points, inverse_distance)

        return self.cache.get_value((self.key, "neighbor filter", *self.sample_key(material)), build_filter)

    def background(self) -> Shaped[F32, "n 3"]:
        """Read the radiance of the background samples."""
        return np.asarray(self.store.read(f"views/{self.index}/diffuse", self.num_surface_samples), np.float32)

    def frosted_background(self) -> Iterator[tuple[float, Shaped[NDArray[np.intp], " k"]]]:
        """Yield the width α of the facets of each frosted glass, and the background samples behind it."""
        if self.frost is None:
            return
        frost = self.store.read(f"views/{self.index}/frost", self.num_surface_samples)
        for index, alpha in enumerate(self.store.attributes["frost"]):
            if alpha and len(rows := np.flatnonzero(frost == index + 1)):
                yield alpha, rows

    def background_directions(self) -> Shaped[NDArray[np.float64], "n 3"]:
        """Read the unit directions of the background samples."""
        return self.store.read(f"views/{self.index}/position", self.num_surface_samples).astype(np.float64)

    def directions_to(self, material: int) -> Shaped[NDArray[np.float64], "n 3"]:
        """Unit directions of the camera rays to a material's samples, from the store."""
        rows = self.rows(material)
        position = self.store.read(f"views/{self.index}/position", rows.start, rows.stop)
        return -view_directions(self.ray_origins(rows), position).astype(np.float64)

    def surface_at(self, sample: int) -> tuple[Shaped[F32, " 3"], Shaped[F32, " 3"]]:
        """Read position and unit normal of a surface sample, in world space."""
        position, normal = (
            self.store.read(f"views/{self.index}/{name}", sample, sample + 1)[0] for name in ("position", "normal")
        )
        return position, normal

    def material_ids(self) -> Shaped[NDArray[np.uint16], "height width"]:
        """Material with the largest weight in each pixel, 65535 for the background."""
        material = np.full(self.num_view_samples, BACKGROUND, np.uint16)
        for index in range(len(self.bounds) - 1):
            material[self.rows(index)] = index
        ids = np.full(self.width * self.height, BACKGROUND, np.uint16)
        by_weight = np.argsort(self.throughput.max(axis=1), kind="stable")  # the largest of a pixel is written last
        pixel_index = np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))
        ids[pixel_index[by_weight]] = material[self.order[by_weight]]
        return ids.reshape(self.height, self.width)

    @cached_property
    def all_tiles(self) -> list[Tile]:
        """Tiles that cover the image: x, y, width, height in pixels."""
        return [
            (x, y, min(TILE_PIXELS, self.width - x), min(TILE_PIXELS, self.height - y))
            for y in range(0, self.height, TILE_PIXELS)
            for x in range(0, self.width, TILE_PIXELS)
        ]

    @cached_property
    def material_tiles(self) -> list[list[Tile]]:
        """The tiles with at least one pixel of each material."""
        columns = -(-self.width // TILE_PIXELS)
        tiles = []
        for index in range(len(self.bounds) - 1):
            y, x = np.divmod(self.pixel[self.rows(index)].astype(np.int64), self.width)
            steps = range(-self._reach, self._reach + 1, max(2 * self._reach, 1))
            codes = [
                np.clip(y + dy, 0, self.height - 1) // TILE_PIXELS * columns
                + np.clip(x + dx, 0, self.width - 1) // TILE_PIXELS
                for dy in steps
                for dx in steps
            ]
            tiles.append([self.all_tiles[code] for code in np.unique(codes)])
        return tiles


def open_view(
    store: StoreReader,
    index: int,
    cache: Cache,
    key: str,
    maps: tuple[Hashable | None, ...] = (),
    rows: Shaped[NDArray[np.int64], " surface_samples"] | None = None,
) -> View:
    """Read the data of a view that every frame needs; visibility stays in the store until an operator needs it.

    Args:
        store: store of the bake. index: index of the view.
        cache: cache for data shared between frames. key: key of the bake in `cache`.
        maps: see `View`. rows: `View.baked_rows`.
    Raises:
        ChunkDamagedError: arrays of the store are inconsistent.
    """
    width, height = store.attributes["size"]
    camera = read_camera(store, index)
    prefix = f"views/{index}"
    pixel = store.read(f"{prefix}/pixel")
    material = store.read(f"{prefix}/material")
    throughput = store.read(f"{prefix}/weight")[:, None]
    has_layers = store.attributes.get("has_layers")
    if has_layers:
        throughput = throughput * store.read(f"{prefix}/transmittance")
    num_materials = len(store.attributes["materials"])
    num_surface = int(np.searchsorted(material, BACKGROUND))
    if len(pixel) == 0 or int(pixel.max()) >= width * height or np.any(material[1:] < material[:-1]):
        raise ChunkDamagedError(prefix, "its samples do not fit its size")
    if num_surface and int(material[num_surface - 1]) >= num_materials:
        raise ChunkDamagedError(prefix, "a sample has a material that does not exist in the scene")
    bounds = np.searchsorted(material[:num_surface], np.arange(num_materials + 1)).astype(np.int64)
    level, pairs = read_roughness_levels(store, index, num_surface), read_level_pairs(store)
    if any(not _are_valid_levels(level[a:b], r) for a, b, r in zip(bounds[:-1], bounds[1:], pairs, strict=True)):
        raise ChunkDamagedError(prefix, "its roughness levels do not fit its materials")
    order = np.argsort(pixel, kind="stable").astype(np.int32)
    origin = read_ray_origins(store, index, 0, num_surface)
    mirrored = read_mirror_samples(store, index, order, throughput, num_surface)
    is_mirrored = store.read(f"{prefix}/is_mirrored", 0, num_surface) if has_layers else np.zeros(num_surface, np.bool_)
    if mirrored is not None:
        throughput[mirrored.sample] = 0
    return View(
        camera=camera,
        index=index,
        width=width,
        height=height,
        store=store,
        cache=cache,
        key=key,
        bounds=bounds,
        pixel=pixel,
        first=np.concatenate([[0], np.cumsum(np.bincount(pixel, minlength=width * height))]).astype(np.int32),
        order=order,
        throughput=np.ascontiguousarray(throughput[order], np.float32),
        frost=_frost_filter(store, prefix, pixel, order, width),
        origin=origin,
        mirrored=mirrored,
        is_mirrored=is_mirrored.astype(np.bool_, copy=False),
        textures=[_textures(store, prefix, *ends) for ends in pairwise(bounds.tolist())],
        level=level,
        level_pairs=pairs,
        maps=maps,
        baked_rows=rows,
    )


def _frost_filter(
    store: StoreReader, prefix: str, pixel: NDArray[np.uint32], order: NDArray[np.int32], width: int
) -> FrostFilter | None:
    if not any(store.attributes.get("frost", ())):
        return None
    frost, material, weight = (store.read(f"{prefix}/{name}") for name in ("frost", "material", "weight"))
    return make_frost_filter(frost, material, pixel, weight, order, width)


def _textures(store: StoreReader, prefix: str, start: int, stop: int) -> dict[str, F32]:
    """Read the scene's textures at a material's samples, without those that are 1 everywhere."""
    read = {name: store.read(f"{prefix}/{name}", start, stop) for name in _TEXTURE_NAMES}
    return {name: values for name, values in read.items() if np.any(values != 1)}


def _are_valid_levels(level: NDArray[np.uint8], pairs: tuple[tuple[float, float], ...]) -> bool:
    """True if the levels of a material's samples are ascending and exist."""
    return len(level) == 0 or (int(level[-1]) < max(1, len(pairs)) and bool(np.all(level[1:] >= level[:-1])))
