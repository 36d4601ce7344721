"""Texture values at surface points: of the scene's own textures, or of images in the look that override them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.roughness_levels import uses_roughness_map
from relume.brdf.texture_slots import ROUGHNESS, TEXTURES, roughness_image, user_images
from relume.images.image_store import load_normal_map, load_roughness_map, load_texture
from relume.look import Look
from relume.look.glass import glass_of, with_glass
from relume.look.model import MeshLook
from relume.look.object_materials import object_materials_of, with_object_materials
from relume.look.uv_transforms import check_uv_transforms, fixed_images
from relume.math.uv_transform import UvTransform
from relume.raytrace.surface_interaction import SurfaceInteraction, triplanar_axes
from relume.raytrace.texture import sample_image
from relume.scene.model import Material, Mesh, Scene, Texture
from relume.scene.tangents import compute_tangents
from relume.scene.texture_encoding import decode_rows

F32 = NDArray[np.float32]


def with_overrides(scene: Scene, look: Look) -> Scene:
    """Apply the materials of objects, normal maps, emission images and glass of a look, as if the file contained them.

    Args:
        scene: any. look: the look.
    Raises:
        ParameterError: the look transforms texture coordinates of images that cannot be transformed.
    """
    check_uv_transforms(look, fixed_images(scene))
    scene = with_glass(with_object_materials(scene, object_materials_of(look)), glass_of(look))
    images = {light.material: light.image for light in look.lights.values() if isinstance(light, MeshLook)}
    materials = tuple(_with_maps(material, look, images.get(material.name)) for material in scene.materials)
    if all(material is own for material, own in zip(materials, scene.materials, strict=True)):
        return scene
    meshes = tuple(
        _with_corners(mesh, scene.materials[mesh.material], materials[mesh.material]) for mesh in scene.meshes
    )
    transforms = [look.materials[material.name].uv_transform for material in materials]
    meshes = tuple(_transformed(mesh, transforms[mesh.material]) for mesh in meshes)
    return replace(scene, materials=materials, meshes=meshes)


def _with_maps(material: Material, look: Look, image: str | None) -> Material:
    """Apply the maps of a look to a material. image: the image that it emits; None: as in the scene."""
    normal_map = look.materials[material.name].normals
    if normal_map is not None:
        terms = _terms_with_roughness_map(material, look)
        material = replace(material, normal_map=load_normal_map(normal_map), terms=terms)
    uv = look.materials[material.name].uv_transform
    if uv is not None:
        own = material.normal_map
        material = replace(material, normal_map=None if own is None else _transformed_normals(own, uv))
    if image is not None:
        material = replace(material, textures={**material.textures, "emission": load_texture(image)})
    return material


def _with_corners(mesh: Mesh, own: Material, material: Material) -> Mesh:
    """Add what the maps of a look need at the corners. own: the material in the scene."""
    if material.normal_map is not own.normal_map and not mesh.tangents.any():
        return _with_tangents(_with_uvs(mesh))
    return mesh if material is own else _with_uvs(mesh)


def _transformed(mesh: Mesh, uv: UvTransform | None) -> Mesh:
    """Transform the texture coordinates of a mesh; its tangents stay, since anisotropy does."""
    return mesh if uv is None else replace(mesh, uvs=uv.points(mesh.uvs))


def _transformed_normals(normal_map: Texture, uv: UvTransform) -> Texture:
    """Normals of a transformed map in the frame of the tangents."""
    return Texture(np.concatenate([uv.normals(rows) for rows in decode_rows(normal_map)]), normal_map.wrap)


def _with_tangents(mesh: Mesh) -> Mesh:
    """Add tangents along u, as imports make them for normal maps."""
    return replace(mesh, tangents=compute_tangents(mesh.positions, mesh.normals, mesh.uvs, mesh.faces))


def _with_uvs(mesh: Mesh) -> Mesh:
    """Add texture coordinates; without any, those of tri-planar mapping, as in `StoredScene`."""
    if mesh.uvs.any():
        return mesh
    corners = mesh.positions[mesh.faces]
    u_axis, v_axis = triplanar_axes(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    u, v = np.einsum("fkc,fc->fk", corners, u_axis), -np.einsum("fkc,fc->fk", corners, v_axis)
    order = mesh.faces.ravel()
    return replace(
        mesh,
        positions=mesh.positions[order],
        normals=mesh.normals[order],
        tangents=mesh.tangents[order],
        uvs=np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32),
        faces=np.arange(len(order), dtype=np.uint32).reshape(-1, 3),
    )


def _terms_with_roughness_map(material: Material, look: Look) -> tuple[dict[str, Any], ...]:
    """A material's own terms, with the roughness map if terms of the look use one, so that normal variation counts."""
    look_terms = look.materials[material.name].terms
    uses_map = [k < len(look_terms) and uses_roughness_map(look_terms[k]) for k in range(len(material.terms))]
    return tuple(
        {**term, "roughness_map": ROUGHNESS} if f else dict(term)
        for term, f in zip(material.terms, uses_map, strict=True)
    )


def surface_textures(
    scene: Scene, look: Look, surface: SurfaceInteraction, material: Shaped[NDArray[np.integer], " n"]
) -> dict[str, F32]:
    """Factors of terms by texture channel, at surface points.

    Args:
        scene: scene with its materials. look: the look. surface: the points.
        material: index of each point's material in the scene; other values keep their textures.
    Returns:
        (n, 3) float32 each
    """
    textures = {"diffuse": surface.diffuse, "specular": surface.specular}
    for index, scene_material in enumerate(scene.materials):
        for channel, name in zip(TEXTURES, user_images(look.materials[scene_material.name].terms), strict=True):
            if name is not None:
                rows = np.flatnonzero(material == index)
                textures[channel] = textures[channel].copy()
                textures[channel][rows] = sample_image(load_texture(name), surface.uv[rows])
    return textures


def surface_roughness(
    scene: Scene, look: Look, surface: SurfaceInteraction, material: Shaped[NDArray[np.integer], " n"]
) -> Shaped[F32, " n"]:
    """Roughness at surface points, relative to the material's terms.

    Args:
        scene, look, surface, material: as in `surface_textures`.
    """
    roughness = surface.roughness
    for index, scene_material in enumerate(scene.materials):
        name = roughness_image(look.materials[scene_material.name].terms)
        if name is not None:
            rows = np.flatnonzero(material == index)
            roughness = roughness.copy()
            roughness[rows] = sample_image(load_roughness_map(name), surface.uv[rows])[:, 0]
    return roughness
