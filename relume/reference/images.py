"""What textures of places on surfaces show: the scene's own images, and those that a look names in their place."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import TEXTURES, images_of, roughness_image
from relume.brdf.levels import follows_map
from relume.images.shelf import mean_roughness, normals_of, roughness_of, texture_of
from relume.look import Look
from relume.scene.gltf.uvs import made_tangents
from relume.scene.model import Material, Mesh, Scene
from relume.scene.roughness import widened
from relume.trace.surface import Surface, projected_axes
from relume.trace.texture import sample_image

F32 = NDArray[np.float32]


def wearing(scene: Scene, look: Look) -> Scene:
    """The scene whose materials have the normal maps that a look names, as if its file had them.

    Args:
        scene: any. look: that is shown.
    """
    normals = [look.materials[own.name].normals for own in scene.materials]
    if not any(normals):
        return scene
    materials = tuple(
        own if map_ is None else replace(own, normal_map=normals_of(map_), terms=_following(own, look))
        for own, map_ in zip(scene.materials, normals, strict=True)
    )
    meshes = tuple(
        mesh if normals[mesh.material] is None or mesh.tangents.any() else _with_tangents(_with_places(mesh))
        for mesh in scene.meshes
    )
    return replace(scene, materials=materials, meshes=meshes)


def _with_tangents(mesh: Mesh) -> Mesh:
    """A mesh with tangents along u, as imports make them for normal maps."""
    return replace(mesh, tangents=made_tangents(mesh.positions, mesh.normals, mesh.uvs, mesh.faces))


def _with_places(mesh: Mesh) -> Mesh:
    """A mesh with places in textures; where there are none, those of a projection, as `relume.trace.surface` has it."""
    if mesh.uvs.any():
        return mesh
    corners = mesh.positions[mesh.faces]
    across, up = projected_axes(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    u, v = np.einsum("fkc,fc->fk", corners, across), -np.einsum("fkc,fc->fk", corners, up)
    order = mesh.faces.ravel()
    return replace(
        mesh,
        positions=mesh.positions[order],
        normals=mesh.normals[order],
        tangents=mesh.tangents[order],
        uvs=np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32),
        faces=np.arange(len(order), dtype=np.uint32).reshape(-1, 3),
    )


def _following(own: Material, look: Look) -> tuple[dict[str, Any], ...]:
    """A material's own terms, which bumps widen where those of a look follow a map."""
    shown = look.materials[own.name].terms
    follows = [k < len(shown) and follows_map(shown[k]) for k in range(len(own.terms))]
    return tuple(
        {**term, "roughness_map": True} if f else dict(term) for term, f in zip(own.terms, follows, strict=True)
    )


def textures_of(scene: Scene, look: Look, surface: Surface, material: NDArray[np.integer]) -> dict[str, F32]:
    """What multiplies terms by their channel, at places on surfaces.

    Args:
        scene: whose materials they are. look: that is shown. surface: the places.
        material: index of each into the scene's materials; others are left as they are. (n,)
    Returns:
        (n, 3) float32 each
    """
    found = {"diffuse": surface.diffuse, "specular": surface.specular}
    for index, own in enumerate(scene.materials):
        for channel, name in zip(TEXTURES, images_of(look.materials[own.name].terms), strict=True):
            if name is not None:
                rows = np.flatnonzero(material == index)
                found[channel] = found[channel].copy()
                found[channel][rows] = sample_image(texture_of(name), surface.uv[rows])
    return found


def roughness_at(scene: Scene, look: Look, surface: Surface, material: NDArray[np.integer]) -> F32:
    """How rough places on surfaces are, over what terms say.

    Args:
        scene, look, surface, material: as in `textures_of`.
    Returns:
        (n,) float32
    """
    found = surface.roughness
    for index, own in enumerate(scene.materials):
        name = roughness_image(look.materials[own.name].terms)
        if name is not None:
            rows = np.flatnonzero(material == index)
            found = found.copy()
            found[rows] = sample_image(roughness_of(name), surface.uv[rows])[:, 0]
            if own.normal_map is not None and (mean := mean_roughness(name)):
                found[rows] = widened(found[rows], surface.normal_length[rows], mean)
    return found
