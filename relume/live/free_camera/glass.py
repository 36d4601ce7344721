"""Glass for the free camera: its reflections are added to the attenuated light behind it; there is no refraction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.fresnel import normal_reflectance, schlick
from relume.look.glass import GlassOfLook
from relume.probes.stored_scene import StoredScene
from relume.raytrace.alpha_test import GLASS_RULE, AlphaMasks
from relume.raytrace.camera_rays import Hits
from relume.raytrace.embree import EmbreeScene

F32 = NDArray[np.float32]


class GlassLayers(NamedTuple):
    """The glass in front of camera rays, nearest first.

    Attributes:
        ray: index of the ray behind each.
        transmittance: fraction of light behind it that reaches the camera.
        rules: of the scene's glass, see `relume.raytrace.alpha_test.AlphaMasks`; edited by looks.
    """

    ray: Shaped[NDArray[np.int64], " g"]
    transmittance: Shaped[F32, "g 3"]
    rules: Shaped[F32, "images 6"]


NO_GLASS = GlassLayers(np.empty(0, np.int64), np.empty((0, 3), np.float32), np.empty((0, 6), np.float32))


def has_glass(embree: EmbreeScene) -> bool:
    """Return whether a scene has glass. embree: its triangles"""
    alpha_test = embree.alpha_test
    return alpha_test is not None and bool((alpha_test.alpha_masks.rules[:, 0] == GLASS_RULE).any())


def find_glass_layers(
    embree: EmbreeScene,
    stored_scene: StoredScene,
    glass_hits: Hits,
    directions: Shaped[F32, "n 3"],
    rules: Shaped[F32, "images 6"] | None = None,
) -> GlassLayers:
    """Return the glass in front of rays.

    Args:
        embree: the triangles. stored_scene: the scene. glass_hits: first hits including glass.
        directions: directions of the rays. rules: of the glass; None: as in the scene.
    """
    masks = _alpha_masks(embree)
    rule_index = np.where(
        glass_hits.face >= 0, masks.material_rule[stored_scene.face_material[np.maximum(glass_hits.face, 0)]], -1
    )
    ray = np.flatnonzero((rule_index >= 0) & (masks.rules[rule_index, 0] == GLASS_RULE))
    glass_rules = masks.rules if rules is None else rules
    of_ray, normal = glass_rules[rule_index[ray]].astype(np.float64), stored_scene.face_normal[glass_hits.face[ray]]
    cosine = np.abs(np.einsum("nc,nc->n", normal, directions[ray])).astype(np.float64)
    f0, sides = of_ray[:, 4], of_ray[:, 5]
    transmittance = (1 - schlick(cosine, f0))[:, None] * of_ray[:, 1:4]
    return GlassLayers(ray, (transmittance ** sides[:, None]).astype(np.float32), glass_rules)


def edited_rules(
    embree: EmbreeScene, names: Sequence[str], before: GlassOfLook, after: GlassOfLook
) -> Shaped[F32, "images 6"]:
    """Return the rules of glass with the colors and indices of refraction of a look.

    Args:
        embree: the triangles. names: names of the scene's materials.
        before, after: glass of the scene, and of the look.
    """
    masks, edited = _alpha_masks(embree), dict(after)
    rules = masks.rules.copy()
    for name, glass in before:
        row, new = masks.material_rule[names.index(name)], edited[name]
        color = np.array(glass.color, np.float32)
        # absorption in solids stays as in the scene, since bakes do not store their thickness
        absorbed = np.divide(rules[row, 1:4], color, out=np.ones(3, np.float32), where=color > 0)
        rules[row, 1:4], rules[row, 4] = new.color * absorbed, normal_reflectance(new.ior)
    return rules


def _alpha_masks(embree: EmbreeScene) -> AlphaMasks:
    assert embree.alpha_test is not None  # callers have glass
    return embree.alpha_test.alpha_masks


def composite_glass(glass: GlassLayers, values: Shaped[F32, " rows *channels"]) -> Shaped[F32, " rays *channels"]:
    """Composite glass over the light behind it: attenuate that light and add the reflection of the glass.

    Args:
        glass: in front of some rays. values: values of the rays, then of the glass; overwritten.
    Returns:
        The values of the rays.
    """
    num = len(values) - len(glass.ray)
    out = values[:num]
    out[glass.ray] = out[glass.ray] * glass.transmittance + values[num:]
    return out


def adjust_alpha(glass: GlassLayers, coverage: Shaped[F32, " rows"]) -> Shaped[F32, " rays"]:
    """Return the coverage of rays including glass. coverage: that of the rays, then that of the glass."""
    out = coverage[: len(coverage) - len(glass.ray)]
    out[glass.ray] = 1 - (1 - out[glass.ray]) * glass.transmittance.mean(axis=1)
    return out
