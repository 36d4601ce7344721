"""Glass while the eye moves: its own highlights are laid over what is straight behind it; nothing is bent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.fresnel import schlick
from relume.live.free_camera.probes.stored_scene import StoredScene
from relume.raytrace.alpha_filter import STOP_AT_OPAQUE
from relume.raytrace.alpha_test import GLASS_RULE
from relume.raytrace.camera_rays import Hits, trace_rays
from relume.raytrace.embree import EmbreeScene

F32 = NDArray[np.float32]


class GlassLayers(NamedTuple):
    """The glass before rays of an eye, nearest first.

    Attributes:
        ray: that each is before. (g,) int64
        transmittance: share of what is behind it that comes to the eye. (g, 3) float32
    """

    ray: NDArray[np.int64]
    transmittance: F32


def trace_glass(embree: EmbreeScene, camera_position: F32, directions: F32) -> Hits | None:
    """Find what rays of an eye meet first, glass included; None where a scene has none.

    Args:
        embree: the triangles. camera_position: (3,) float32. directions: of the rays, unit. (n, 3) float32
    """
    alpha_test = embree.alpha_test
    if alpha_test is None or not (alpha_test.alpha_masks.rules[:, 0] == GLASS_RULE).any():
        return None
    return trace_rays(embree, camera_position, directions, STOP_AT_OPAQUE)


def find_glass_layers(embree: EmbreeScene, stored_scene: StoredScene, glass_hits: Hits, directions: F32) -> GlassLayers:
    """Tell which rays glass is before.

    Args:
        embree: the triangles. stored_scene: of the scene. glass_hits: from `trace_glass`. directions: of the rays. (n,
            3) float32
    """
    assert embree.alpha_test is not None
    cutouts = embree.alpha_test.alpha_masks
    rule_index = np.where(
        glass_hits.face >= 0, cutouts.material_rule[stored_scene.face_material[np.maximum(glass_hits.face, 0)]], -1
    )
    ray = np.flatnonzero((rule_index >= 0) & (cutouts.rules[rule_index, 0] == GLASS_RULE))
    rules, normal = cutouts.rules[rule_index[ray]].astype(np.float64), stored_scene.face_normal[glass_hits.face[ray]]
    cosine = np.abs(np.einsum("nc,nc->n", normal, directions[ray])).astype(np.float64)
    f0, sides = rules[:, 4], rules[:, 5]
    transmittance = (1 - schlick(cosine, f0))[:, None] * rules[:, 1:4]
    return GlassLayers(ray, (transmittance ** sides[:, None]).astype(np.float32))


def composite_glass(glass: GlassLayers, values: F32) -> F32:
    """Add the radiance of glass to what comes through it.

    Args:
        glass: before some of the rays. values: of the rays, then of the panes. (rays + g, …) float32
    Returns:
        Of the rays. (rays, …) float32
    """
    num = len(values) - len(glass.ray)
    out = values[:num]
    out[glass.ray] = out[glass.ray] * glass.transmittance + values[num:]
    return out


def adjust_alpha(glass: GlassLayers, coverage: F32) -> F32:
    """How much rays hide of what is behind all, glass included. hides: of the rays, then of the panes. (rays,)"""
    out = coverage[: len(coverage) - len(glass.ray)]
    out[glass.ray] = 1 - (1 - out[glass.ray]) * glass.transmittance.mean(axis=1)
    return out
