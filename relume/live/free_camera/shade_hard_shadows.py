"""Shading with hard-shadow lights: unoccluded light is interpolated between probes, visibility is traced per pixel.

    B(pixel) = Σ_probes w (B − S) + V(pixel) Σ_probes w U

S is a probe's light from the source with the probe's own visibility; U is the unoccluded light. Incident coefficients
used with hard-shadow lights exclude S; V is the visible fraction from
`relume.live.free_camera.adaptive_shadows`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.free_camera.basis.highlight_lobes import build_lobes
from relume.live.free_camera.basis.material_tables import Tables
from relume.live.free_camera.hard_shadow_lights import HardShadowLight
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.primary_visibility import GBuffer, interpolate_to_nodes
from relume.live.free_camera.shade_pixels import InterpolatedProbes, MirrorData, shade_pixels
from relume.live.free_camera.shade_probes import shade_probes
from relume.probes.stored_scene import StoredScene
from relume.scene.model import Camera

F32 = NDArray[np.float32]


class BeamMaterials(Protocol):
    """Interface of `relume.live.free_camera.frame.MaterialState`."""

    @property
    def tables(self) -> Tables: ...
    @property
    def is_reflective(self) -> NDArray[np.bool_]: ...


def add_direct_sharp(
    hard_shadow_lights: Sequence[HardShadowLight],
    shadow_visibility: Sequence[F32],
    stored_scene: StoredScene,
    gbuffer: GBuffer,
    camera: Camera,
    pixel_angle: float,
    materials: BeamMaterials,
    unused_environment: PrefilteredEnvironment,
    rays: Shaped[NDArray[np.int32], " n"] | None,
    out: Shaped[F32, "rays 3"],
) -> None:
    """Add the reflected light of hard-shadow lights, for terms that the basis represents.

    Args:
        hard_shadow_lights: hard-shadow lights of the illumination.
        shadow_visibility: shadow visibility of each along the rays. (rays,) float32 each
        stored_scene: the scene. gbuffer: G-buffer of the rays. camera: camera of the rays.
        pixel_angle: angle of a pixel, radians.
        materials: materials of the surfaces. unused_environment: any; it is not shown.
        rays: the rays to shade; None: all.
        out: radiance, float32, added to.
    """
    num_materials = len(materials.is_reflective)
    viewed = stored_scene.viewed_from(camera.to_world[:3, 3], gbuffer.is_needed)
    dark = np.zeros((num_materials, 3), np.float32)
    lobe_visibility, gradients = np.zeros((0, 3), np.float32), np.zeros((0, 4), np.float32)
    mirror_data = MirrorData(
        build_lobes([[]] * num_materials), unused_environment, lobe_visibility, gradients, is_fine=False
    )
    for light, visibility in zip(hard_shadow_lights, shadow_visibility, strict=True):
        rows = np.flatnonzero(visibility > 0).astype(np.int32) if rays is None else rays[visibility[rays] > 0]
        probe_radiance = shade_probes(viewed, light.vectors, None, materials.tables).radiance
        interpolated_probes = InterpolatedProbes(
            interpolate_to_nodes(stored_scene, gbuffer.is_visible, probe_radiance),
            materials.is_reflective,
            _light_directions(stored_scene, light),
        )
        radiance = shade_pixels(stored_scene, gbuffer, pixel_angle, interpolated_probes, dark, mirror_data, rows)
        out[rows] += radiance[rows] * (visibility[rows, None] * light.gain)


def _light_directions(stored_scene: StoredScene, light: HardShadowLight) -> F32:
    """Direction to a hard-shadow light from each lattice node, for normal maps. (nodes or 0, 3) float32"""
    if not len(stored_scene.tangents):
        return np.empty((0, 3), np.float32)
    if light.targets.is_far:
        return np.tile(light.center, (len(stored_scene.lattice_nodes.normal), 1))
    directions = light.center - stored_scene.probes.position
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), np.float32(1e-20))
    return np.asarray(directions[stored_scene.lattice_nodes.probe[:, 0]], np.float32)
