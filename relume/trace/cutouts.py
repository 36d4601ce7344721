"""Surfaces that rays may pass: which triangles are of them, and where.

A material's opacity (`relume.scene.model.Opacity`) cuts: from a bound on, a surface is there; or it blends, and a
surface is there for a share of the rays, its opacity. Glass is there for eyes, and for a share of light's rays. Rays
find out while Embree traces them (`relume.trace.cutout_filter`), whatever they are traced for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.errors import ChunkDamagedError
from relume.scene.model import WRAPS, Glass, Material, Opacity

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]
BLENDS, PASSES = -1.0, -2.0  # instead of a bound: shares of opacity; glass
MOST_TINTS = 3  # groups of tints that are told from each other
TINTED = 0.05  # by how much the shares of channels differ at least that pass a side of glass which has a colour


class Cutouts(NamedTuple):
    """The opacity of a scene's materials.

    Attributes:
        texels: opacity, 255 where a surface is there; images one after another, row after row. (texels,) uint8
        images: first texel, height, width, how u and v continue. (num, 5) int64
        rules: opacity from which a surface is there, or `BLENDS`, or `PASSES`; then for glass the share of red, green
            and blue that passes it but for what it reflects, the latter head-on, and how many sides it has.
            (num, 6) float32
        of_material: row of the two above, −1 where nothing passes a material. (materials,) int32
    """

    texels: NDArray[np.uint8]
    images: NDArray[np.int64]
    rules: F32
    of_material: NDArray[np.int32]


def cutouts_of(materials: Sequence[Material]) -> Cutouts | None:
    """Collect the opacity and the glass of materials; None where there is neither."""
    texels, images, rules = list[NDArray[np.uint8]](), list[list[int]](), list[tuple[float, ...]]()
    of_material, end = np.full(len(materials), -1, np.int32), 0
    for index, material in enumerate(materials):
        if not material.lets_pass:
            continue
        opacity = material.opacity or Opacity(np.full((1, 1), 255, np.uint8))
        of_material[index] = len(images)
        images.append([end, *opacity.alpha.shape, *map(WRAPS.index, opacity.wrap)])
        bound = BLENDS if opacity.cutoff is None else opacity.cutoff
        rules.append((bound, *[0.0] * 5) if material.glass is None else _of_glass(material.glass))
        texels.append(opacity.alpha.ravel())
        end += opacity.alpha.size
    if not images:
        return None
    return Cutouts(np.concatenate(texels), np.array(images, np.int64), np.array(rules, np.float32), of_material)


def is_tinted(glass: Glass) -> bool:
    """Tell whether glass has a colour that its shadows show."""
    passed = _of_glass(glass)[1:4]
    return max(passed) - min(passed) > TINTED


def tint_groups(cutouts: Cutouts) -> NDArray[np.int32]:
    """Number the tints of glass from 1 on: those that are nearly alike share a number, and all beyond the last do.

    Returns:
        Of each image; 0 of what has no tint. (images,) int32
    """
    passed = cutouts.rules[:, 1:4]
    is_glass = cutouts.rules[:, 0] == PASSES
    group, first = np.zeros(len(passed), np.int32), list[NDArray[np.float32]]()
    for row in np.flatnonzero(is_glass & (np.ptp(passed, axis=1) > TINTED)):
        off = [float(np.abs(passed[row] - tint).max()) for tint in first]
        if (not off or min(off) > TINTED) and len(first) < MOST_TINTS:
            first.append(passed[row])
            group[row] = len(first)
        else:
            group[row] = 1 + int(np.argmin(off))
    return group


def _of_glass(glass: Glass) -> tuple[float, ...]:
    """Half of what a solid absorbs at each of its two sides: light's rays do not know how long they were inside."""
    passed = np.array(glass.tint) * np.exp(-np.array(glass.absorbed) * glass.thickness / 2)
    return PASSES, *passed.tolist(), ((glass.ior - 1) / (glass.ior + 1)) ** 2, 2.0 if glass.thickness > 0 else 1.0


def check_cutouts(arrays: Mapping[str, NDArray[Any]], num_materials: int) -> Cutouts:
    """Make cut-outs of the arrays of a store, by the names of the fields.

    Raises:
        ChunkDamagedError: they do not fit each other; rays would read beyond their ends.
    """
    cutouts = Cutouts(*(np.ascontiguousarray(arrays[name]) for name in Cutouts._fields))
    shapes = (cutouts.images.shape, cutouts.rules.shape, cutouts.of_material.shape)
    types = [array.dtype.name for array in cutouts]
    num = len(cutouts.rules)
    fits = shapes == ((num, 5), (num, 6), (num_materials,)) and types == ["uint8", "int64", "float32", "int32"]
    if fits and num:
        first, height, width, *wraps = cutouts.images.T
        fits = min(first.min(), height.min() - 1, width.min() - 1, np.min(wraps)) >= 0
        fits &= max(height.max(), width.max()) < 1 << 20 and int(np.max(wraps)) < len(WRAPS)
        fits &= bool((first + height * width <= cutouts.texels.size).all())
    if not fits or not -1 <= int(cutouts.of_material.min(initial=-1)) <= int(cutouts.of_material.max(initial=-1)) < num:
        raise ChunkDamagedError("scene/cutouts", "its images do not fit its texels or materials")
    return cutouts
