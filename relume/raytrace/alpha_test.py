"""Alpha-tested, blended and glass surfaces: their triangles, opacity and tints.

A material's opacity (`relume.scene.model.Opacity`) has a cutoff, from which the surface is opaque, or blends: the
surface stops a fraction of the rays equal to its opacity. Glass stops all camera rays, and a fraction of shadow rays.
`relume.raytrace.alpha_filter` decides during traversal, for all rays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.fresnel import normal_reflectance
from relume.core.errors import ChunkDamagedError
from relume.scene.model import WRAPS, Glass, Material, Opacity

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]
BLEND_RULE, GLASS_RULE = -1.0, -2.0  # instead of a cutoff
MAX_TINTS = 3  # groups of tints that are distinguished
MIN_TINT_DIFFERENCE = 0.05  # between the channels' transmittances of a surface of tinted glass


class AlphaMasks(NamedTuple):
    """Opacity of a scene's materials.

    Attributes:
        texels: opacity, 255 is opaque; row-major images in sequence.
        images: first texel, height, width, wrap modes of u and v.
        rules: cutoff, or `BLEND_RULE`, or `GLASS_RULE`; then for glass the transmittance of red, green and blue without
            Fresnel reflectance, the Fresnel reflectance at normal incidence, and the number of sides.
        material_rule: row of `images` and `rules`, −1 for opaque materials.
    """

    texels: Shaped[NDArray[np.uint8], " texels"]
    images: Shaped[NDArray[np.int64], "images 5"]
    rules: Shaped[F32, "images 6"]
    material_rule: Shaped[NDArray[np.int32], " materials"]

    @property
    def is_glass(self) -> Shaped[NDArray[np.bool_], " materials"]:
        """True for materials that transmit light."""
        return np.isin(self.material_rule, np.flatnonzero(self.rules[:, 0] == GLASS_RULE))


def collect_alpha_masks(materials: Sequence[Material]) -> AlphaMasks | None:
    """Collect the opacity and glass of materials; None if there is neither."""
    texels, images, rules = list[NDArray[np.uint8]](), list[list[int]](), list[tuple[float, ...]]()
    material_rule, num_texels = np.full(len(materials), -1, np.int32), 0
    for index, material in enumerate(materials):
        if not material.is_alpha_tested:
            continue
        opacity = material.opacity or Opacity(np.full((1, 1), 255, np.uint8))
        material_rule[index] = len(images)
        images.append([num_texels, *opacity.alpha.shape, *map(WRAPS.index, opacity.wrap)])
        rule = BLEND_RULE if opacity.cutoff is None else opacity.cutoff
        rules.append((rule, *[0.0] * 5) if material.glass is None else _glass_rule(material.glass))
        texels.append(opacity.alpha.ravel())
        num_texels += opacity.alpha.size
    if not images:
        return None
    return AlphaMasks(np.concatenate(texels), np.array(images, np.int64), np.array(rules, np.float32), material_rule)


def is_tinted(glass: Glass) -> bool:
    """True if glass has a color that is visible in its shadows."""
    transmittance = _glass_rule(glass)[1:4]
    return max(transmittance) - min(transmittance) > MIN_TINT_DIFFERENCE


def tint_groups(alpha_masks: AlphaMasks) -> Shaped[NDArray[np.int32], " images"]:
    """Group the tints of glass images: similar tints share a number from 1; 0 has no tint.

    Tints beyond `MAX_TINTS` groups join the most similar group.
    """
    transmittance = alpha_masks.rules[:, 1:4]
    is_glass = alpha_masks.rules[:, 0] == GLASS_RULE
    group, group_tints = np.zeros(len(transmittance), np.int32), list[NDArray[np.float32]]()
    for row in np.flatnonzero(is_glass & (np.ptp(transmittance, axis=1) > MIN_TINT_DIFFERENCE)):
        distances = [float(np.abs(transmittance[row] - tint).max()) for tint in group_tints]
        if (not distances or min(distances) > MIN_TINT_DIFFERENCE) and len(group_tints) < MAX_TINTS:
            group_tints.append(transmittance[row])
            group[row] = len(group_tints)
        else:
            group[row] = 1 + int(np.argmin(distances))
    return group


def _glass_rule(glass: Glass) -> tuple[float, ...]:
    """Rule of glass. Each side of a solid absorbs half, because shadow rays do not know their length inside."""
    transmittance = np.array(glass.tint) * np.exp(-np.array(glass.absorbed) * glass.thickness / 2)
    return (
        GLASS_RULE,
        *transmittance.tolist(),
        normal_reflectance(glass.ior),
        2.0 if glass.thickness > 0 else 1.0,
    )


def check_alpha_masks(arrays: Mapping[str, NDArray[Any]], num_materials: int) -> AlphaMasks:
    """Make alpha masks of the arrays of a store, named like the fields.

    Raises:
        ChunkDamagedError: their sizes do not match; rays would read out of bounds.
    """
    alpha_masks = AlphaMasks(*(np.ascontiguousarray(arrays[name]) for name in AlphaMasks._fields))
    shapes = (alpha_masks.images.shape, alpha_masks.rules.shape, alpha_masks.material_rule.shape)
    types = [array.dtype.name for array in alpha_masks]
    num = len(alpha_masks.rules)
    fits = shapes == ((num, 5), (num, 6), (num_materials,)) and types == ["uint8", "int64", "float32", "int32"]
    if fits and num:
        first, height, width, *wraps = alpha_masks.images.T
        fits = min(first.min(), height.min() - 1, width.min() - 1, np.min(wraps)) >= 0
        fits &= max(height.max(), width.max()) < 1 << 20 and int(np.max(wraps)) < len(WRAPS)
        fits &= bool((first + height * width <= alpha_masks.texels.size).all())
    if (
        not fits
        or not -1
        <= int(alpha_masks.material_rule.min(initial=-1))
        <= int(alpha_masks.material_rule.max(initial=-1))
        < num
    ):
        raise ChunkDamagedError("alpha_masks", "its images do not fit its texels or materials")
    return alpha_masks
