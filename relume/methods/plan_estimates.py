"""What a bake needs at most, from the scene and the recipe alone: samples of a view, and memory of a process.

Nothing is traced to plan a bake, so the number of samples is bounded by what a pixel can hold; foliage and hair come
near it, most scenes have one to two. Bytes were measured, and are rounded up so that every scene stays below them:
`relume bench plan` prints the share of the bounds that scenes take.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

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
LIGHT_BYTES_PER_TEXEL = 270  # while the environment is divided into triangles: directions, weights, places in the tree
BYTES_PER_RAY = 300  # a camera ray with its hit, the surface there, and what they are merged by
_PIXEL_BYTES = 16  # of what is known of every pixel before samples are made, and while they are looked through
_SPLIT_BYTES, _TINT_BYTES = 36, 12  # of a sample, while tinted light is looked for; of each of its tints
_WRITING_BYTES = 64 << 20  # a shard of a column, as it is, compressed, and while it is read
_MIP_CHAIN_FRACTION = 1 / 3  # of a texture's texels, in half precision
_MIP_PEAK_FACTOR = 2  # of the largest texture's bytes, while its first halving is made
_ALPHA_MASK_BYTES = 80  # of a material: its row of `relume.raytrace.alpha_test.AlphaMasks`
_LIGHT_BYTES = 112  # of a light triangle in the store: nodes, direction, power, place in the tree


def max_view_samples(scene: Scene, recipe: Recipe) -> int:
    """View samples of one view."""
    width, height = recipe.size
    return view_sample_limit(scene.materials, width * height)


def num_camera_rays(scene: Scene, recipe: Recipe) -> int:
    """Rays that find the samples of all views: one through each pixel, then all positions of each, and all layers."""
    width, height = recipe.size
    rays_per_pixel = 2 + sum(map(len, PATTERNS))  # where many found too much, fewer are tried
    return rays_per_pixel * width * height * len(recipe.views) * max_layers(scene.materials)


def num_tinted_rays(scene: Scene, num_samples: int) -> int:
    """Rays that find which of some samples see light through tinted glass."""
    return num_samples * max_tint_rays(scene.materials)


def lights_bytes(scene: Scene, recipe: Recipe) -> int:
    """Of the store: the light triangles, and the environment to weigh them by."""
    return recipe.num_lights * _LIGHT_BYTES + scene.environment.radiance.nbytes


def triangles_bytes(scene: Scene) -> int:
    """Of the store: the triangles, their corners, the material and the mesh of each, how brightly they shine where
    images say it; where rays pass some, which and where."""
    bytes_per_face = 12 if has_emission_images(scene) else 8
    triangles = sum(
        mesh.positions.nbytes + mesh.faces.nbytes + bytes_per_face * len(mesh.faces) for mesh in scene.meshes
    )
    if not any(material.is_alpha_tested for material in scene.materials):
        return triangles
    return triangles + sum(mesh.uvs.nbytes for mesh in scene.meshes) + opacity_bytes(scene)


def opacity_bytes(scene: Scene) -> int:
    """Of all opacity, and of what says how materials are passed."""
    images = sum(material.opacity.alpha.nbytes for material in scene.materials if material.opacity is not None)
    return images + len(scene.materials) * _ALPHA_MASK_BYTES


def corner_bytes(scene: Scene) -> int:
    """Of the store: the corners' places in textures, and their tangents in half precision."""
    return sum(mesh.uvs.nbytes + mesh.tangents.nbytes // 2 for mesh in scene.meshes)


def texture_bytes(scene: Scene) -> int:
    """Of all textures and normal maps, in half precision."""
    return sum(texture.pixels.size * 2 for texture in _textures(scene))


def distinct_textures(scene: Scene) -> list[Texture]:
    """All textures and normal maps, each once, whatever materials have it."""
    return list({id(texture): texture for texture in _textures(scene)}.values())


def num_triangles(scene: Scene) -> int:
    """Of all meshes together."""
    return sum(len(mesh.faces) for mesh in scene.meshes)


def supersampling_ratio(scene: Scene, recipe: Recipe) -> float:
    """Samples by all positions of all pixels ÷ those that a plan counts: work goes with the number of pixels."""
    num_pixels = recipe.size[0] * recipe.size[1]
    return POSITIONS_PER_PIXEL * num_pixels * max_samples(scene.materials) / max_view_samples(scene, recipe)


def estimated_work(scene: Scene, num_rays: float, ray_ns: float, triangle_us: float) -> float:
    """What one core takes for a bake, about.

    Args:
        scene: whose triangles take their part: they are merged, and searched, and some are looked at one by one.
        num_rays: of all positions. ray_ns, triangle_us: of one of them, and of a triangle, as measured of a method.
    """
    return 1e-9 * ray_ns * num_rays + 1e-6 * triangle_us * num_triangles(scene)


def process_bytes(scene: Scene) -> int:
    """What a process holds between tasks: the program, the scene, its merged triangles, their tree, mip pyramids."""
    textures = [texture.pixels.nbytes for texture in _textures(scene)]
    mip_bytes = sum(_MIP_CHAIN_FRACTION * texture.pixels.size * 2 for texture in _textures(scene))
    meshes = [array.nbytes for mesh in scene.meshes for array in _arrays(mesh)]
    largest = max([scene.environment.radiance.nbytes, *textures, *meshes])  # read from disk, it is there twice
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
    """What a task of the first stage takes besides: the lights, or the samples of a view."""
    num_pixels = recipe.size[0] * recipe.size[1]
    num_rays = (1 + POSITIONS_PER_PIXEL) * min(num_pixels, TILE_SIZE**2) * max_layers(scene.materials)
    tints = num_tints(scene.materials)
    split = (_SPLIT_BYTES + tints * _TINT_BYTES) * max_view_samples(scene, recipe) if tints else 0
    sampling = num_rays * BYTES_PER_RAY + num_pixels * _PIXEL_BYTES + split + _WRITING_BYTES
    return max(light_selection_bytes(scene), sampling)


def light_selection_bytes(scene: Scene) -> int:
    """What it takes to choose the lights."""
    height, width, _ = scene.environment.radiance.shape
    return int(height * width) * LIGHT_BYTES_PER_TEXEL


def _textures(scene: Scene) -> list[Texture]:
    textures = [texture for material in scene.materials for texture in material.textures.values()]
    return textures + [material.normal_map for material in scene.materials if material.normal_map is not None]


def _arrays(mesh: Mesh) -> list[NDArray[Any]]:
    return [mesh.positions, mesh.normals, mesh.tangents, mesh.uvs, mesh.faces]


def check_gathering(recipe: Recipe, max_samples: int) -> None:
    """Refuse numbers of patches and gather rays that no store can have.

    Args:
        recipe: whose `num_patches` and `gather_rays` are checked. max_samples: that the method can keep; 0 where
            it gathers no light.
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
