"""What surfaces send of beams, as far as rays see them: unhidden light is interpolated between points, shadows are not.

    B(pixel) = Σ_points w (B − S) + V(pixel) Σ_points w U

S is what a point knows of the beam, with the shadows that points know; U what it would get if nothing were in the
way. Light vectors that are shown beside beams lack S; V is the share that
`relume.live.free_camera.hard_shadow_lights.shadows` finds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relume.live.free_camera.basis.highlight_lobes import build_lobes
from relume.live.free_camera.basis.material_tables import Tables
from relume.live.free_camera.hard_shadows.lights import HardShadowLight
from relume.live.free_camera.highlights.environment_lobe_lookup import PrefilteredEnvironment
from relume.live.free_camera.primary_visibility import GBuffer, interpolate_to_nodes
from relume.live.free_camera.probes.stored_scene import StoredScene
from relume.live.free_camera.shade_pixels import InterpolatedProbes, MirrorData, shade_pixels
from relume.live.free_camera.shade_probes import shade_probes
from relume.scene.model import Camera

F32 = NDArray[np.float32]


class BeamMaterials(Protocol):
    """What is asked of `relume.live.free_camera.frame.MaterialState`."""

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
    rays: NDArray[np.int32] | None,
    out: F32,
) -> None:
    """Add what surfaces send of beams, by the terms that the in-basis tells.

    Args:
        hard_shadow_lights: of the light. shadow_visibility: that rays see of each. (rays,) float32 each
        stored_scene: that is seen. gbuffer: by the rays. camera: the eye. pixel_angle: that a pixel spans, radians.
        materials: of the surface. unused_environment: any; nothing of it is shown.
        rays: that are asked; None: all. (n,) int32
        out: added to there. (rays, 3) float32
    """
    num_materials, camera_position = len(materials.is_reflective), camera.to_world[:3, 3].astype(np.float32)
    dark = np.zeros((num_materials, 3), np.float32)
    lobe_visibility, gradients = np.zeros((0, 3), np.float32), np.zeros((0, 4), np.float32)
    mirror_data = MirrorData(
        build_lobes([[]] * num_materials), unused_environment, lobe_visibility, gradients, is_fine=False
    )
    for light, visibility in zip(hard_shadow_lights, shadow_visibility, strict=True):
        rows = np.flatnonzero(visibility > 0).astype(np.int32) if rays is None else rays[visibility[rays] > 0]
        probe_radiance = shade_probes(
            stored_scene, light.vectors, None, materials.tables, camera_position, gbuffer.is_needed
        ).radiance
        interpolated_probes = InterpolatedProbes(
            interpolate_to_nodes(stored_scene, gbuffer.is_visible, probe_radiance),
            materials.is_reflective,
            _light_directions(stored_scene, light),
        )
        radiance = shade_pixels(stored_scene, gbuffer, pixel_angle, interpolated_probes, dark, mirror_data, rows)
        out[rows] += radiance[rows] * (visibility[rows, None] * light.gain)


def _light_directions(stored_scene: StoredScene, light: HardShadowLight) -> F32:
    """Where a beam comes from, for normal maps: seen from each vertex. (vertices or 0, 3) float32"""
    if not len(stored_scene.tangents):
        return np.empty((0, 3), np.float32)
    if light.targets.is_far:
        return np.tile(light.center, (len(stored_scene.lattice_nodes.normal), 1))
    directions = light.center - stored_scene.probes.position
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), np.float32(1e-20))
    return np.asarray(directions[stored_scene.lattice_nodes.probe[:, 0]], np.float32)
