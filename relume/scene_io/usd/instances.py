"""UsdGeomPointInstancer: transforms of the instances of each prototype."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, quote, unsupported
from relume.scene_io.gltf.nodes import rotations
from relume.scene_io.usd.primvars import as_rows

F64 = NDArray[np.float64]
MAX_POINTS = 100_000


def instance_transforms(
    instancer: Any, time: Any, warnings: list[ImporterWarning]
) -> Iterator[tuple[Any, Shaped[F64, "instances 4 4"]]]:
    """Yield each prototype, and its transforms to the space of the instancer; masked instances are left out.

    Args:
        instancer: a UsdGeom.PointInstancer. time: a UsdTimeCode. warnings: gets a sentence if instances are skipped.
    """
    from pxr import UsdGeom

    prim = instancer.GetPrim()
    label = quote(prim.GetName())
    numbers = np.asarray(instancer.GetProtoIndicesAttr().Get(time) or [], np.int64)
    if len(numbers) > MAX_POINTS:
        warnings.append(unsupported(f"Skipped {label}: it has more than {MAX_POINTS:,} instances; use fewer."))
        return
    matrices = _matrices(instancer, time, len(numbers))
    if matrices is None:
        warnings.append(unsupported(f"Skipped {label}: its positions and prototypes differ in number."))
        return
    mask = instancer.ComputeMaskAtTime(time)
    is_shown = np.asarray(mask, np.bool_) if len(mask) == len(numbers) else np.ones(len(numbers), np.bool_)
    is_shown &= np.isfinite(matrices).all(axis=(1, 2))
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    prototypes = [prim.GetStage().GetPrimAtPath(path) for path in targets]
    for number, prototype in enumerate(prototypes):
        if prototype:
            local = UsdGeom.Xformable(prototype).GetLocalTransformation(time)
            yield prototype, matrices[is_shown & (numbers == number)] @ np.array(local).T
    missing = [number for number, prototype in enumerate(prototypes) if not prototype]
    is_missing = (numbers < 0) | (numbers >= len(prototypes)) | np.isin(numbers, missing)
    if (is_shown & is_missing).any():
        count = int((is_shown & is_missing).sum())
        warnings.append(unsupported(f"Skipped {count:,} instances of {label}: they have no prototype."))


def _matrices(instancer: Any, time: Any, count: int) -> Shaped[F64, "instances 4 4"] | None:
    """Translation · rotation · scale of each instance; None if their numbers differ."""
    positions = as_rows(instancer.GetPositionsAttr().Get(time), 3)
    scales = as_rows(instancer.GetScalesAttr().Get(time), 3)
    quaternions = as_rows(instancer.GetOrientationsfAttr().Get(time) or instancer.GetOrientationsAttr().Get(time), 4)
    scales = np.ones((count, 3)) if scales is None or not len(scales) else scales
    if quaternions is None or not len(quaternions):
        quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    if positions is None or not len(positions) == len(scales) == len(quaternions) == count:
        return None
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = rotations(quaternions) * scales[:, None, :]
    matrices[:, :3, 3] = positions
    return matrices
