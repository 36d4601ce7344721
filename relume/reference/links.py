"""Links of lights in the reference: the meshes that a link names, and the mesh at a point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.look.model import IncludeLink, Link
from relume.raytrace.alpha_filter import STOP_AT_PARTIAL
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.embree import OMITTED_VERTEX, EmbreeScene
from relume.raytrace.scene_buffers import SceneBuffers
from relume.scene.model import Mesh, Scene

F32 = NDArray[np.float32]


def is_linked(scene: Scene, mesh: Mesh, link: Link) -> bool:
    """True if a link names a mesh of a scene, or its material."""
    names = link.include if isinstance(link, IncludeLink) else link.exclude
    is_named = mesh.name in names.objects or scene.materials[mesh.material].name in names.materials
    return is_named == isinstance(link, IncludeLink)


def lit_meshes(scene: Scene, link: Link | None) -> Sequence[bool] | None:
    """For each mesh, True if a light with this link lights it; None for a light that lights all."""
    return None if link is None else [is_linked(scene, mesh, link) for mesh in scene.meshes]


def shadow_casters(scene: Scene, geometry: SceneBuffers, link: Link | None) -> SceneBuffers:
    """Return the triangles that cast the shadows of a light.

    Args:
        scene: the scene. geometry: all of its triangles. link: shadow link of the light; None: all cast shadows.
    """
    if link is None:
        return geometry
    casts = np.array([is_linked(scene, mesh, link) for mesh in scene.meshes])[geometry.face_mesh]
    faces = np.where(casts[:, None], geometry.faces, OMITTED_VERTEX)
    return replace(geometry, embree=EmbreeScene.build(geometry.positions, faces, geometry.embree.alpha_test))


def lit_points(
    geometry: SceneBuffers,
    position: Shaped[F32, "n 3"],
    normal: Shaped[F32, "n 3"],
    meshes: Sequence[bool] | None,
) -> Shaped[NDArray[np.bool_], " n"]:
    """True for points on lit meshes.

    Args:
        geometry: all triangles. position, normal: of the points, offset from their surface. meshes: from `lit_meshes`.
    """
    if meshes is None:
        return np.ones(len(position), np.bool_)
    face = trace_rays(geometry.embree, position, -normal, STOP_AT_PARTIAL).face
    return np.asarray((face >= 0) & np.array(meshes)[geometry.face_mesh[face]])
