"""Upper bounds for a bake, from scene and recipe alone: samples per view, memory per process.

Planning traces no rays, so the number of samples is bounded by the capacity of a pixel; foliage and hair come near it,
most scenes have one to two. Bytes were measured, and are rounded up so that every scene stays below:
`relume bench plan` prints actual sizes as fractions of the bounds.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from relume.camera.lens_rays import PILOT_RAYS, RAYS_PER_PIXEL
from relume.camera.merge_rays import PATTERNS, POSITIONS_PER_PIXEL
from relume.camera.spectral_split import max_tint_rays, num_tints
from relume.camera.tiling import TILE_SIZE
from relume.camera.transparency_layers import max_layers, max_samples
from relume.camera.view_samples import view_sample_limit
from relume.core.errors import PlanError
from relume.raytrace.gather_rays import MAX_RAYS
from relume.scene.emission import has_emission_images
from relume.scene.model import Mesh, Scene, Texture
from relume.store.bake_protocol import Recipe

MIN_REQUESTED_PATCHES, MIN_GATHER_RAYS = 64, 16
PROGRAM_BYTES = 360_000_000  # of a process: interpreter, libraries, compiled kernels

_TREE_BYTES_PER_TRIANGLE = 160  # Embree's, while it is built
LIGHT_BYTES_PER_TEXEL = 270  # while the environment is divided into triangles: directions, weights, tile codes
BYTES_PER_RAY = 300  # a camera ray with its hit, its surface, and the keys for merging
_PIXEL_BYTES = 16  # per-pixel data before samples are created, and during a scan
_SPLIT_BYTES, _TINT_BYTES = 36, 12  # per sample while tinted light is traced; per tint of a sample
_WRITING_BYTES = 64 << 20  # a shard of a column: raw, compressed, and as it is read
_MIP_CHAIN_FRACTION = 1 / 3  # of a texture's texels, in half precision
_MIP_PEAK_FACTOR = 2  # of the largest texture's bytes, while its first mip level is computed
_ALPHA_MASK_BYTES = 80  # per material: its row of `relume.raytrace.alpha_test.AlphaMasks`
_LIGHT_BYTES = 112  # per light triangle in the store: nodes, direction, power, tile code


def max_view_samples(scene: Scene, recipe: Recipe) -> int:
    """Maximum number of view samples of one view."""
    width, height = recipe.size
    return view_sample_limit(scene.materials, width * height, has_lens=has_lens(scene, recipe))


def has_lens(scene: Scene, recipe: Recipe) -> bool:
    """True if any camera of a recipe has a lens."""
    return any(camera.lens is not None for camera in scene.cameras if camera.name in recipe.views)


def num_camera_rays(scene: Scene, recipe: Recipe) -> int:
    """Number of camera rays of all views: one per pixel, then all positions of each pixel, and all layers."""
    width, height = recipe.size
    # patterns with too many samples are retried with fewer
    rays_per_pixel = 2 + sum(map(len, PATTERNS))
    if has_lens(scene, recipe):
        rays_per_pixel = len(RAYS_PER_PIXEL) * PILOT_RAYS + sum(RAYS_PER_PIXEL)
    return rays_per_pixel * width * height * len(recipe.views) * max_layers(scene.materials)


def num_tinted_rays(scene: Scene, num_samples: int) -> int:
    """Number of rays that find samples with light through tinted glass."""
    return num_samples * max_tint_rays(scene.materials)


def lights_bytes(scene: Scene, recipe: Recipe) -> int:
    """Store size of the light triangles and of the environment's radiance."""
    return recipe.num_lights * _LIGHT_BYTES + scene.environment.radiance.nbytes


def triangles_bytes(scene: Scene) -> int:
    """Store size of the triangles: vertices, normals, UV coordinates, material, mesh, emission, and alpha masks."""
    bytes_per_face = 12 if has_emission_images(scene) else 8
    triangles = sum(
        3 * mesh.positions.nbytes // 2 + mesh.uvs.nbytes + mesh.faces.nbytes + bytes_per_face * len(mesh.faces)
        for mesh in scene.meshes
    )
    if not any(material.is_alpha_tested for material in scene.materials):
        return triangles
    return triangles + opacity_bytes(scene)


def opacity_bytes(scene: Scene) -> int:
    """Size of all opacity textures and alpha-test parameters."""
    images = sum(material.opacity.alpha.nbytes for material in scene.materials if material.opacity is not None)
    return images + len(scene.materials) * _ALPHA_MASK_BYTES


def tangent_bytes(scene: Scene) -> int:
    """Store size of the vertices' tangents, in half precision."""
    return sum(mesh.tangents.nbytes // 2 for mesh in scene.meshes)


def texture_bytes(scene: Scene) -> int:
    """Size of all textures and normal maps, in half precision."""
    return sum(texture.pixels.size * 2 for texture in _textures(scene))


def distinct_textures(scene: Scene) -> list[Texture]:
    """Return all textures and normal maps, each once, even if materials share it."""
    return list({id(texture): texture for texture in _textures(scene)}.values())


def num_triangles(scene: Scene) -> int:
    """Number of triangles of all meshes."""
    return sum(len(mesh.faces) for mesh in scene.meshes)


def supersampling_ratio(scene: Scene, recipe: Recipe) -> float:
    """Ratio of samples at all positions of all pixels to the planned samples: work scales with the number of pixels."""
    num_pixels = recipe.size[0] * recipe.size[1]
    positions = RAYS_PER_PIXEL[0] if has_lens(scene, recipe) else POSITIONS_PER_PIXEL
    return positions * num_pixels * max_samples(scene.materials) / max_view_samples(scene, recipe)


def estimated_work(scene: Scene, num_rays: float, ray_ns: float, triangle_us: float) -> float:
    """Estimate the time of a bake on one core, in seconds.

    Args:
        scene: its triangles add time: they are merged, sorted into a tree, and in part processed one by one.
        num_rays: at all positions. ray_ns, triangle_us: measured per ray and per triangle for a method.
    """
    return 1e-9 * ray_ns * num_rays + 1e-6 * triangle_us * num_triangles(scene)


def process_bytes(scene: Scene) -> int:
    """Memory of a process between tasks: program, scene, merged triangles, acceleration structure, mip pyramids."""
    textures = [texture.pixels.nbytes for texture in _textures(scene)]
    mip_bytes = sum(_MIP_CHAIN_FRACTION * texture.pixels.size * 2 for texture in _textures(scene))
    meshes = [array.nbytes for mesh in scene.meshes for array in _arrays(mesh)]
    largest = max([scene.environment.radiance.nbytes, *textures, *meshes])  # held twice while it is read from disk
    return (
        PROGRAM_BYTES
        + scene.environment.radiance.nbytes
        + 2 * sum(meshes)
        + num_triangles(scene) * _TREE_BYTES_PER_TRIANGLE
        + sum(textures)
        + int(mip_bytes)
        + 2 * opacity_bytes(scene)
        + _MIP_PEAK_FACTOR * largest
    )


def sampling_bytes(scene: Scene, recipe: Recipe) -> int:
    """Additional memory of a task of the first stage: the lights, or the samples of a view."""
    num_pixels = recipe.size[0] * recipe.size[1]
    num_rays = (1 + POSITIONS_PER_PIXEL) * min(num_pixels, TILE_SIZE**2) * max_layers(scene.materials)
    tints = num_tints(scene.materials)
    split = (_SPLIT_BYTES + tints * _TINT_BYTES) * max_view_samples(scene, recipe) if tints else 0
    sampling = num_rays * BYTES_PER_RAY + num_pixels * _PIXEL_BYTES + split + _WRITING_BYTES
    return max(light_selection_bytes(scene), sampling)


def light_selection_bytes(scene: Scene) -> int:
    """Memory for the selection of the lights."""
    height, width, _ = scene.environment.radiance.shape
    return int(height * width) * LIGHT_BYTES_PER_TEXEL


def _textures(scene: Scene) -> list[Texture]:
    textures = [texture for material in scene.materials for texture in material.textures.values()]
    return textures + [material.normal_map for material in scene.materials if material.normal_map is not None]


def _arrays(mesh: Mesh) -> list[NDArray[Any]]:
    return [mesh.positions, mesh.normals, mesh.tangents, mesh.uvs, mesh.faces]


def check_gathering(recipe: Recipe, max_samples: int) -> None:
    """Check the numbers of patches and gather rays of a recipe.

    Args:
        recipe: with `num_patches` and `gather_rays`. max_samples: maximum of the method; 0 if it has no gathering.
    Raises:
        PlanError: they are out of bounds.
    """
    for count, minimum, maximum, label in (
        (recipe.num_patches, MIN_REQUESTED_PATCHES, max_samples, "patches"),
        (recipe.gather_rays, MIN_GATHER_RAYS, MAX_RAYS, "gather rays"),
    ):
        if count is None:
            continue
        if max_samples == 0:
            raise PlanError(f"{count} {label} were asked for; method {recipe.method} has none, leave them out")
        if not minimum <= count <= maximum:
            raise PlanError(f"{count} {label} were asked for; give {minimum} to {maximum:,}")
