"""Surfaces that rays may pass: which triangles are of them, and where.

A material's opacity (`relume.scene.model.Opacity`) cuts: from a bound on, a surface is there; or it blends, and a
surface is there for a share of the rays, its opacity. Glass is there for eyes, and for a share of light's rays. Rays
find out while Embree traces them (`relume.raytrace.alpha_filter`), whatever they are traced for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import ChunkDamagedError
from relume.scene.model import WRAPS, Glass, Material, Opacity

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]
BLEND_RULE, GLASS_RULE = -1.0, -2.0  # instead of a bound: shares of opacity; glass
MAX_TINTS = 3  # groups of tints that are told from each other
MIN_TINT_DIFFERENCE = (
    0.05  # by how much the shares of channels differ at least that pass a side of glass which has a colour
)


class AlphaMasks(NamedTuple):
    """The opacity of a scene's materials.

    Attributes:
        texels: opacity, 255 where a surface is there; images one after another, row after row. (texels,) uint8
        images: first texel, height, width, how u and v continue. (num, 5) int64
        rules: opacity from which a surface is there, or `BLEND_RULE`, or `GLASS_RULE`; then for glass the share of red,
            green and blue that passes it but for what it reflects, the latter head-on, and how many sides it has.
            (num, 6) float32
        material_rule: row of the two above, −1 where nothing passes a material. (materials,) int32
    """

    texels: NDArray[np.uint8]
    images: NDArray[np.int64]
    rules: F32
    material_rule: NDArray[np.int32]


def collect_alpha_masks(materials: Sequence[Material]) -> AlphaMasks | None:
    """Collect the opacity and the glass of materials; None where there is neither."""
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
    """Tell whether glass has a colour that its shadows show."""
    transmittance = _glass_rule(glass)[1:4]
    return max(transmittance) - min(transmittance) > MIN_TINT_DIFFERENCE


def tint_groups(alpha_masks: AlphaMasks) -> NDArray[np.int32]:
    """Number the tints of glass from 1 on: those that are nearly alike share a number, and all beyond the last do.

    Returns:
        Of each image; 0 of what has no tint. (images,) int32
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
    """Half of what a solid absorbs at each of its two sides: light's rays do not know how long they were inside."""
    transmittance = np.array(glass.tint) * np.exp(-np.array(glass.absorbed) * glass.thickness / 2)
    return (
        GLASS_RULE,
        *transmittance.tolist(),
        ((glass.ior - 1) / (glass.ior + 1)) ** 2,
        2.0 if glass.thickness > 0 else 1.0,
    )


def check_alpha_masks(arrays: Mapping[str, NDArray[Any]], num_materials: int) -> AlphaMasks:
    """Make cut-outs of the arrays of a store, by the names of the fields.

    Raises:
        ChunkDamagedError: they do not fit each other; rays would read beyond their ends.
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
