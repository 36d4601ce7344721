"""Reflected light alone, of a gather bake and of Mitsuba's path tracer, with the same bounces."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.mitsuba import render
from relume.look import validate
from relume.look.document import MAX_BOUNCES
from relume.scene.model import Scene
from relume.transfer.opened import Transfer
from relume.transfer.render import render_image

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def reflected(transfer: Transfer, terms: Mapping[str, Sequence[Mapping[str, Any]]]) -> F64:
    """Light of a picture that surfaces have reflected onto what is seen. (height, width, 3)

    Args:
        terms: of materials that have others than in the scene's own look.
    """
    document = copy.deepcopy(transfer.default_look)
    for name, of_material in terms.items():
        document["materials"][name]["terms"] = [dict(term) for term in of_material]
    pictures = []
    for shown in ("all", "direct"):
        document["transport"]["show"] = shown
        look = validate(document, transfer.default_look)
        pictures.append(render_image(transfer, "front", look).astype(np.float64))
    return np.asarray(pictures[0] - pictures[1])


def mitsuba_job(seen: Sequence[Any], beyond: Sequence[Any]) -> dict[str, Any]:
    """What `bench.mitsuba.render` is to be told besides counts; arguments as of `reflected_by_mitsuba`."""
    return {"seen": seen, "bsdfs": beyond, "bounces": MAX_BOUNCES}


def reflected_by_mitsuba(
    scene: Scene, size: tuple[int, int], seen: Sequence[Any], beyond: Sequence[Any], spp: int, folder: Path
) -> F32:
    """Two independent halves of Mitsuba's picture of the same light. (2, height, width, 3)

    Args:
        seen, beyond: BSDFs of the meshes where the camera sees them, and further along paths.
        spp: of each half.
    """
    render(scene, size, {"spp": [spp], "passes": 2, **mitsuba_job(seen, beyond)}, folder)
    return np.asarray(np.load(folder / "passes.npy", allow_pickle=False), np.float32)


def error_without_noise(ours: F64, halves: F32) -> dict[str, float]:
    """Relative RMSE against the mean that two noisy halves share: E[(o − a)(o − b)] = (o − mean)².

    Returns:
        "error", "bias" of the means, and "noise" of the two halves' mean.
    """
    one, other = halves.astype(np.float64)
    scale = np.sqrt(np.mean(one * other))
    squared = np.mean((ours - one) * (ours - other))
    return {
        "error": float(np.sqrt(max(0.0, squared)) / scale),
        "bias": float(ours.mean() / halves.mean(dtype=np.float64) - 1),
        "noise": float(np.sqrt(np.mean((one - other) ** 2)) / 2 / scale),
    }
