"""Light of an open bake along lobe rays, traced when the lobe is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.equirect import (
    halve_to_width,
    rotate_about_y,
    texel_directions,
    texel_solid_angles,
)
from relume.brdf.albedo import Documents, Reflectance, Reflectances, directional_albedo, quantized_reflectance
from relume.brdf.lobe_sampling import LobeSampling, lobe_of
from relume.brdf.texture_slots import TEXTURES, EmissionImage
from relume.lights.sphere_tiles import Tiles
from relume.lights.spherical_triangles import TriangleLights
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.opened.retrace import NormalRetracer
from relume.math.uv_transform import UvTransform
from relume.methods.patch_layout import read_tree
from relume.patches.patch_kdtree import NO_PATCH, NO_PATCH_NODE, PatchTree
from relume.raytrace.lobe_directions import LobePattern, make_lobe_pattern
from relume.raytrace.surface_textures import (
    MapName,
    TextureCoordinates,
    Textures,
    project_missing,
    read_textures,
    replace_textures,
    texture_coordinates,
    transform_coordinates,
)
from relume.store.bake_protocol import StoreReader
from relume.store.optional_arrays import read_optional
from relume.transport.hit_textures import NO_TEXTURES, HitTextures, hit_textures, row_of_slot, textured_light
from relume.transport.lobe_hits import LobeHits, trace_lobe_rays
from relume.transport.lobe_paths import LobeSurfaces, edge_curvature
from relume.transport.lobe_rays import NO_EMISSION, LobeEnvironment
from relume.transport.lobe_scene import LobeLinks, LobeScene
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.patch_lookup import PatchLookup, patch_reach
from relume.transport.shading_points import GatherRays, ShadingPoints

F32 = NDArray[np.float32]

_ALBEDO_STEPS = 64
_PEAK, _MAX_PEAKS = 8, 32  # brightness of peaks by the mean, and their number
_BRIGHT = 2  # radiance by the mean of triangles that share their light with rays
_MAX_LOBES, _LEAST_ALBEDO = 255, 0.15  # of the materials from which rays go on
_WIDE = np.radians(1.0)  # median of a lobe behind which texels are averaged
_BLUR = 1.5  # of the environment behind a second lobe, by the median of its half angle
_PREVIEW_RAYS, _NARROW_RAYS, _LOBE_RAYS = 34, 89, 144  # of a sample, Fibonacci numbers


class HitImages(NamedTuple):
    """Images of a look that lobe rays meet.

    Attributes:
        names: images that replace textures of each material, as columns of `Textures.material_textures`.
        transforms: of the texture coordinates of each material, None for none; empty for none at all.
    """

    names: tuple[tuple[MapName | None, ...], ...]
    transforms: tuple[UvTransform | None, ...] = ()


def hit_images(
    reflectances: Reflectances, materials: Sequence[str], emission: Mapping[str, EmissionImage]
) -> HitImages:
    """Return the images of a look that lobe rays meet.

    Args:
        reflectances: of all materials, or empty. materials: their names. emission: emitted image of each, by name.
    """
    images = [each.images for each in reflectances] or [(None, None)] * len(materials)
    names = tuple((*image, None, emission.get(name)) for image, name in zip(images, materials, strict=True))
    return HitImages(names, tuple(each.uv for each in reflectances))


class LobePatches(NamedTuple):
    """Textures and reflectances of patches, for lobe rays.

    Attributes:
        mean: of each of `TEXTURES` on each patch.
        unit_share: share of the terms with each texture in a patch's reflectance, divided by the mean.
        broad_share: share of a patch's isotropic radiance that its narrow lobe does not reflect.
    """

    mean: Shaped[F32, "2 patches 3"]
    unit_share: Shaped[F32, "2 patches 3"]
    broad_share: Shaped[F32, " patches"]


def no_lobe_patches() -> LobePatches:
    """Return the textures and reflectances of a scene without patches."""
    shape = len(TEXTURES), NO_PATCH + 1, 3
    return LobePatches(np.ones(shape, np.float32), np.zeros(shape, np.float32), np.ones(NO_PATCH + 1, np.float32))


class LobeTracer:
    """Traces lobe rays from samples of a bake.

    Args:
        store: the bake's. tracer: with the triangles of the scene.
    """

    def __init__(self, store: StoreReader, tracer: NormalRetracer) -> None:
        self._store, self._tracer = store, tracer
        self._textures_with = lru_cache(maxsize=1)(self._replace_textures)  # a look's are as large as the baked ones

    def pattern(self, lobe: LobeSampling, quality: LightQuality) -> LobePattern:
        """Return the rays of every sample: fewer for a narrow lobe, and for a preview."""
        num_rays = _NARROW_RAYS if lobe.median.max() < _WIDE else _LOBE_RAYS
        if quality is LightQuality.PREVIEW:
            num_rays = _PREVIEW_RAYS
        return make_lobe_pattern(lobe, num_rays, int(self._store.attributes.get("gather_seed", 0)))

    def scene(
        self,
        reflectances: Reflectances,
        images: HitImages,
        patches: LobePatches,
        outgoing: OutgoingLight,
        emission: Shaped[F32, "materials 3"],
        links: LobeLinks,
        *,
        goes_on: bool,
    ) -> LobeScene:
        """Return the surfaces that lobe rays meet. See `LobeScene`.

        Args:
            reflectances: of all materials. images: of the look, see `hit_images`.
            patches: their textures and reflectances.
            outgoing, emission, links: as in `LobeScene`. goes_on: rays go on from narrow lobes.
        """
        tint = patches.mean[TEXTURES.index("specular")]
        surfaces = self._surfaces(reflectances if goes_on else (), tint, images)
        textured = textured_light(outgoing.isotropic, patches.unit_share, patches.mean, surfaces.textures.slots)
        light_args = outgoing, textured, patches.broad_share, emission if goes_on else NO_EMISSION
        return LobeScene(self._tracer.geometry, self._lookup, surfaces, *light_args, links)

    def _surfaces(self, reflectances: Reflectances, tint: Shaped[F32, "patches 3"], images: HitImages) -> LobeSurfaces:
        """Return the surfaces that rays meet; those of `reflectances` with narrow lobes pass rays on."""
        geometry, lobes = self._tracer.geometry, list(map(_narrow_lobe, reflectances))
        textures = self._textures_with(images)
        materials = [index for index, lobe in enumerate(lobes) if lobe is not None][:_MAX_LOBES]
        found = [lobe for lobe in lobes if lobe is not None][:_MAX_LOBES]
        row = np.full(len(self._store.attributes["materials"]), -1, np.int32)
        row[materials] = np.arange(len(materials))
        quantile, band_density = (
            _padded([lobe.quantile[0] for lobe, _ in found]),
            _padded([lobe.band_density[0] for lobe, _ in found]),
        )
        num_bands = np.array([lobe.band_density.shape[1] for lobe, _ in found], np.float32)
        median = np.array([lobe.median[0] for lobe, _ in found], np.float32)
        return LobeSurfaces(
            face_material=geometry.face_material,
            normals=self.normals,
            curvature=self._curvature,
            lobe=row,
            quantile=quantile,
            band_density=band_density,
            is_half_angle=np.array([lobe.is_half_angle for lobe, _ in found], np.bool_),
            scale=np.asarray(num_bands / (np.pi / 2), np.float32),
            albedo=np.array([_albedo_by_cosine(documents) for _, documents in found], np.float32).reshape(
                -1, _ALBEDO_STEPS, 3
            ),
            blur=np.asarray(np.where(median > _WIDE, _BLUR * median, 0), np.float32),
            tint=tint,
            textures=textures,
            specular=row_of_slot(textures.slots, TEXTURES.index("specular")),
            glass=self._glass,
            is_two_sided=np.array(self._store.attributes["double_sided"], np.bool_),
            origins=geometry.origins,
        )

    def _replace_textures(self, images: HitImages) -> HitTextures:
        """Return the textures of all surfaces. images: of the look, see `hit_images`"""
        if self._textures is None:
            return NO_TEXTURES
        baked, coordinates = self._textures
        textures, geometry = replace_textures(baked, images.names), self._tracer.geometry
        has_texture = np.asarray((textures.material_textures[:, : len(TEXTURES)] >= 0).any(axis=1))
        mesh_args = geometry.positions, geometry.faces, geometry.face_normals, has_texture[geometry.face_material]
        coordinates = project_missing(coordinates, *mesh_args)
        return hit_textures(textures, transform_coordinates(coordinates, geometry.face_material, images.transforms))

    @cached_property
    def _textures(self) -> tuple[Textures, TextureCoordinates] | None:
        """Textures as baked, and their coordinates; None for a store without them."""
        geometry, uvs = self._tracer.geometry, read_optional(self._store, "scene/uvs")
        if uvs is None:
            return None
        return read_textures(self._store), texture_coordinates(uvs, geometry.positions, geometry.faces)

    @cached_property
    def _glass(self) -> Shaped[F32, "materials 4"]:
        """Glass of all materials, see `LobeSurfaces`."""
        alpha_test = self._tracer.geometry.embree.alpha_test
        if alpha_test is None or not np.any(alpha_test.alpha_masks.is_glass):
            return np.empty((0, 4), np.float32)
        row, rules = alpha_test.alpha_masks.material_rule, alpha_test.alpha_masks.rules
        materials = np.flatnonzero(alpha_test.alpha_masks.is_glass)
        glass = np.full((len(row), 4), -1, np.float32)
        glass[materials] = rules[row[materials], 1:5]
        return glass

    @cached_property
    def normals(self) -> F32:
        """Normals of the corners; empty for a store that lacks them."""
        normals = read_optional(self._store, "scene/normals")
        return np.empty((0, 3), np.float32) if normals is None else normals.astype(np.float32)

    @cached_property
    def _curvature(self) -> Shaped[F32, " faces"]:
        """Curvature of all triangles, see `LobeSurfaces`."""
        geometry = self._tracer.geometry
        if not len(self.normals):
            return np.zeros(len(geometry.faces), np.float32)
        return edge_curvature(geometry.positions[geometry.faces], self.normals[geometry.faces])

    @cached_property
    def _lookup(self) -> PatchLookup:
        geometry = self._tracer.geometry
        sides = (2 * geometry.face_mesh).astype(np.int32)
        position = read_optional(self._store, "patches/position")
        if position is None:  # direct light alone
            tree, position = _no_patches(int(sides.max(initial=0)) + 2), np.empty((0, 1, 3), np.float32)
        else:
            tree = read_tree(self._store)
        return PatchLookup(tree, geometry.face_normals, sides, patch_reach(position))


def _padded(rows: Sequence[F32]) -> F32:
    """Stack rows of different lengths, padded with their last value."""
    width = max(map(len, rows), default=0)
    padded = [np.pad(row, (0, width - len(row)), mode="edge") for row in rows]
    return np.array(padded, np.float32).reshape(len(rows), width)


def _albedo_by_cosine(documents: Documents) -> Shaped[NDArray[np.float64], "steps 3"]:
    """Return the directional albedo of terms at equal steps of cos θo."""
    theta_o, values = directional_albedo(documents)
    cosine = np.linspace(0, 1, _ALBEDO_STEPS)
    return np.stack([np.interp(cosine, np.cos(theta_o)[::-1], column[::-1]) for column in values.T], axis=1)


def _narrow_lobe(reflectance: Reflectance) -> tuple[LobeSampling, Documents] | None:
    """Return the first lobe of a material whose narrow highlights are strong, and their terms; None for others."""
    lobes = ((document, lobe_of(document)) for document in reflectance.lobes)
    # tangents are unknown at hits
    narrow = [(document, lobe) for document, lobe in lobes if lobe is not None and lobe.is_round]
    documents = tuple(document for document, _ in narrow)
    if _albedo(documents) < _LEAST_ALBEDO:
        return None
    return narrow[0][1], documents


def _albedo(documents: Documents) -> float:
    """Return the mean reflectance of highlights."""
    return sum(float(quantized_reflectance(document)[:, 0].mean()) for document in documents)


def only_broad(rays: GatherRays, receivers: ShadingPoints, lobe: LobeSampling) -> GatherRays:
    """Remove the gather rays of points whose light is traced along their lobe; neighbors do not share with them.

    Args:
        rays: of `receivers`, which have roughness levels. lobe: of the term.
    """
    is_broad = ~lobe.is_narrow[receivers.level]
    gather_hits = np.where(is_broad[:, None], rays.gather_hits, np.uint16(NO_PATCH))
    sharing = rays.sharing and rays.sharing.among_highlights(is_broad)
    return replace(rays, gather_hits=gather_hits, sharing=sharing)


def trace_lobes(
    scene: LobeScene,
    receivers: ShadingPoints,
    footprint: Shaped[F32, "#n 2 2 3"],
    pattern: LobePattern,
    is_canceled: Callable[[], bool],
) -> LobeHits:
    """Trace the lobe rays of points. See `trace_lobe_rays`.

    Args:
        scene: that is met. receivers: the points. footprint: of each in its pixel. pattern: their rays.
        is_canceled: polled.
    """
    points_args = receivers.points, receivers.wo, footprint, receivers.level
    return trace_lobe_rays(scene.geometry, scene.lookup, scene.surfaces, *points_args, pattern, is_canceled)


def narrow_surfaces(reflectances: Reflectances) -> tuple[str, ...]:
    """Return the digest of each reflectance from which lobe rays go on, empty for others; () if there is none."""
    digests = tuple(each.digest if reflects_narrowly(each) else "" for each in reflectances)
    return digests if any(digests) else ()


def reflects_narrowly(reflectance: Reflectance) -> bool:
    """True if lobe rays go on from a material."""
    return _narrow_lobe(reflectance) is not None


def broad_share(reflectance: Reflectance) -> float:
    """Share of a material's reflectance that its narrow highlights do not have."""
    narrow = _narrow_lobe(reflectance)
    if narrow is None:
        return 1.0
    total = float(reflectance.matrix[:, :, 0].sum(axis=0).mean())
    return max(0.0, 1 - _albedo(narrow[1]) / max(total, 1e-6))


def _no_patches(num_sides: int) -> PatchTree:
    """Return the tree of a scene without patches."""
    return PatchTree(
        np.zeros(1, np.uint8),
        np.zeros(1, np.float32),
        np.full((1, 2), NO_PATCH_NODE, np.int32),
        np.full(num_sides, NO_PATCH_NODE, np.int32),
    )


def tile_of_texels(tiles: Tiles, shape: tuple[int, int], rotation: float) -> Shaped[NDArray[np.int32], "height width"]:
    """Return the light triangle of each texel of an environment.

    Args:
        tiles: of the bake. shape: height and width of the map. rotation: of the map about +Y, degrees.
    """
    directions = rotate_about_y(texel_directions(*shape).reshape(-1, 3).astype(np.float64), rotation)
    return tiles.locate(directions).reshape(shape)


def _halved(radiance: F32) -> list[F32]:
    """Return a map and its halves down to one row."""
    images = [radiance]
    while min(images[-1].shape[:2]) > 1 and images[-1].shape[0] % 2 == images[-1].shape[1] % 2 == 0:
        images.append(halve_to_width(images[-1], images[-1].shape[1] // 2))
    return images


def choose_peaks(
    radiance: Shaped[F32, "height width 3"], tile: Shaped[NDArray[np.int32], "height width"], lights: TriangleLights
) -> tuple[NDArray[np.intp], Shaped[F32, "K 3"], Shaped[F32, "height width 3"]]:
    """Choose the brightest triangles of an environment: hardly any ray of two wide lobes meets them.

    Args:
        radiance: the map. tile: triangle of each texel. lights: the triangles.
    Returns:
        The triangles; the irradiance of their light above a limit, on surfaces perpendicular to it; the map without it.
    """
    limited = np.minimum(radiance, _PEAK * radiance.mean(axis=(0, 1)))
    excess = (radiance - limited) * texel_solid_angles(*radiance.shape[:2])[:, None, None]
    num, flat = lights.num_lights, tile.ravel()
    irradiance = np.stack([np.bincount(flat, channel.ravel(), num) for channel in np.moveaxis(excess, 2, 0)], axis=1)
    peaks = np.argsort(-irradiance.sum(axis=1), kind="stable")[:_MAX_PEAKS]
    peaks = peaks[irradiance[peaks].sum(axis=1) > 0]
    is_peak = np.zeros(num, np.bool_)
    is_peak[peaks] = True
    return peaks, irradiance[peaks].astype(np.float32), np.where(is_peak[tile][..., None], limited, radiance)


def bright_triangles(lights: TriangleLights) -> NDArray[np.intp]:
    """Return the triangles of an environment whose light is shared between them and lobe rays, ascending.

    All other light comes along rays. The sum is the light in any case: this decides where its noise is least. However
    small a bright triangle is, the few rays at the foot of a lobe that meet it alone would be white dots.
    """
    power = lights.irradiance.sum(axis=1)
    return np.flatnonzero(power / np.maximum(lights.solid_angle, 1e-12) > _BRIGHT * power.sum() / (4 * np.pi))


def lobe_environment(
    radiance: Shaped[F32, "height width 3"],
    tile: Shaped[NDArray[np.int32], "height width"],
    rotation: float,
    lights: TriangleLights,
    without_peaks: Shaped[F32, "height width 3"],
    shared: NDArray[np.intp],
    *,
    is_direct: bool,
) -> LobeEnvironment:
    """Return an environment for lobe rays. See `LobeEnvironment`.

    Args:
        radiance: the map, times its gain. tile: from `tile_of_texels`. rotation: degrees. lights: its triangles.
        without_peaks: from `choose_peaks`. shared: triangles that share their light with rays.
        is_direct: as in `LobeEnvironment`.
    """
    cosine_sine = np.array([np.cos(np.radians(rotation)), np.sin(np.radians(rotation))], np.float32)
    images = _halved(np.ascontiguousarray(without_peaks, np.float32))
    shapes = np.array([image.shape[:2] for image in images])
    sizes = shapes.prod(axis=1)
    levels = np.column_stack([np.cumsum(sizes) - sizes, shapes])
    texels = np.concatenate([image.reshape(-1, 3) for image in images])
    light_args = lights.direction[shared], lights.radius[shared], lights.solid_angle[shared]
    row = np.full(lights.num_lights, -1, np.int32)
    row[shared] = np.arange(len(shared))
    arrays = np.ascontiguousarray(radiance, np.float32), row[tile], cosine_sine
    return LobeEnvironment(*arrays, *light_args, texels, levels.astype(np.int64), is_direct)
