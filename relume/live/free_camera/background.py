"""Background compositing for the free camera, and on shadow catchers.

As in fixed views (`relume.live.fixed_camera.background`), a shadow catcher shows the background times the
ratio of incident light with and without the objects; if no light would arrive, nothing is occluded.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import LUMINANCE, srgb_encode
from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.fixed_camera.background import MAX_CATCHER_RATIO
from relume.live.fixed_camera.illumination import Illumination
from relume.live.free_camera.environment_lookup import sample
from relume.live.free_camera.primary_visibility import GBuffer
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.look.model import BackgroundLook
from relume.probes.stored_scene import StoredScene

F32 = NDArray[np.float32]

_MAX_CATCHER_RATIO = np.float32(MAX_CATCHER_RATIO)
_LUMINANCE = np.array(LUMINANCE, np.float32)


class ShadowCatcher(NamedTuple):
    """The shadow catchers of a scene.

    Attributes:
        is_shadow_catcher: per material.
        unoccluded: outgoing radiance of a white surface at each lattice node of a catcher, in unoccluded light; empty
            if there is no catcher.
    """

    is_shadow_catcher: Shaped[NDArray[np.bool_], " materials"]
    unoccluded: Shaped[F32, "nodes 3"]


def background_radiance(
    transfer: FreeCameraTransfer,
    background: BackgroundLook,
    light: Illumination,
    gain: Shaped[F32, " 3"],
    gbuffer: GBuffer,
    is_shadow_catcher: Shaped[NDArray[np.bool_], " materials"],
) -> Shaped[F32, "rays 3"]:
    """Return the background along rays that show it or a shadow catcher, float32; zero elsewhere.

    Args:
        transfer: transfer of the picture. background, light: background and light of its look.
        gain: gain of the finished image per channel.
        gbuffer: G-buffer of the rays. is_shadow_catcher: per material.
    """
    num_rays = len(gbuffer.directions)
    if background.kind == "color":
        return np.tile(np.array(background.color, np.float32), (num_rays, 1))
    radiance = np.zeros((num_rays, 3), np.float32)
    if background.kind != "transparent":
        face, face_material = gbuffer.hits.face, transfer.stored_scene.face_material
        if is_shadow_catcher.any():
            face = np.where((face >= 0) & is_shadow_catcher[face_material[np.maximum(face, 0)]], -1, face).astype(
                np.int32
            )
        environment_map = transfer.environment_map(
            light.environment.map, background.blur if background.kind == "blurred" else 0.0
        )
        environment_gain = np.array(light.environment_gain, np.float32) * gain
        sample(environment_map, light.environment.rotation, environment_gain, face, gbuffer.directions, radiance)
    return radiance


def composite_over(
    stored_scene: StoredScene,
    gbuffer: GBuffer,
    background: Shaped[F32, "rays 3"],
    shadow_catcher: ShadowCatcher,
    gain: Shaped[F32, " 3"],
    *,
    is_direct: bool,
    out: Shaped[F32, "rays 3"],
) -> Shaped[F32, " rays"]:
    """Composite surfaces over the background, and shadows of catchers onto it.

    Args:
        stored_scene: the scene. gbuffer: G-buffer of the rays. background: from `background_radiance`.
        shadow_catcher: data of
            shadow catchers.
        gain: that `out` has been multiplied by.
        is_direct: direct light is shown, and with it the background.
        out: radiance of surfaces, with catchers as white surfaces; overwritten with the composite.
    Returns:
        Coverage along each ray.
    """
    coverage = np.empty(len(out), np.float32)
    surface_args = gbuffer, stored_scene.face_material, shadow_catcher
    args = *surface_args, background, np.asarray(gain, np.float32), is_direct
    parallel_for_chunks(lambda start, stop: _composite_over(*args, start, stop, out, coverage), len(out))
    return coverage


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _composite_over(  # type: ignore[no-untyped-def]
    gbuffer, face_material, shadow_catcher, background, gain, is_direct, start, stop, out, coverage
):
    """Composite rays [start, stop)."""
    face, lattice_node, weight = gbuffer.hits.face, gbuffer.lattice_node, gbuffer.weight
    is_shadow_catcher, unoccluded = shadow_catcher
    direct_factor = np.float32(1) if is_direct else np.float32(0)
    for p in range(start, stop):
        if face[p] < 0:
            coverage[p] = 0
            for channel in range(3):
                out[p, channel] = direct_factor * background[p, channel]
        elif not is_shadow_catcher[face_material[face[p]]]:
            coverage[p] = 1
        else:
            coverage[p] = 1
            for channel in range(3):
                unoccluded_radiance, is_lit = np.float32(0), gain[channel] > 0
                for k in range(3):
                    node_value = unoccluded[lattice_node[p, k], channel]
                    unoccluded_radiance += weight[p, k] * node_value
                    is_lit &= node_value > 0
                # at the edge of a cone, indirect light would be divided by nearly zero
                shadow_ratio = (
                    min(out[p, channel] / (gain[channel] * unoccluded_radiance), _MAX_CATCHER_RATIO)
                    if is_lit
                    else direct_factor
                )
                out[p, channel] = shadow_ratio * background[p, channel]
                coverage[p] -= _LUMINANCE[channel] * min(shadow_ratio, np.float32(1))


def alpha(coverage: Shaped[F32, " ..."], *, for_display: bool) -> Shaped[F32, " ..."]:
    """Return the alpha of pixels over display values (sRGB) or linear values. See `composite_over`."""
    return np.asarray(1 - srgb_encode(1 - coverage), np.float32) if for_display else coverage
