"""UsdGeomPointInstancer: transforms of the instances of each prototype."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, quote, unsupported

F64 = NDArray[np.float64]
MAX_POINTS = 100_000


def instance_transforms(
    instancer: Any, time: Any, warnings: list[ImporterWarning]
) -> Iterator[tuple[Any, Shaped[F64, "instances 4 4"]]]:
    """Yield each prototype, and its transforms to the space of the instancer; masked instances are left out.

    Args:
        instancer: a UsdGeom.PointInstancer. time: a UsdTimeCode. warnings: gets a sentence if instances are skipped.
    """
    prim = instancer.GetPrim()
    label = quote(prim.GetName())
    numbers = np.asarray(instancer.GetProtoIndicesAttr().Get(time) or [], np.int64)
    if len(numbers) > MAX_POINTS:
        warnings.append(unsupported(f"Skipped {label}: it has more than {MAX_POINTS:,} instances; use fewer."))
        return
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    transforms = instancer.ComputeInstanceTransformsAtTime(
        time, time, instancer.IncludeProtoXform, instancer.IgnoreMask
    )
    if len(transforms) != len(numbers):
        warnings.append(unsupported(f"Skipped {label}: its positions and prototypes differ in number."))
        return
    matrices = np.array(transforms, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    mask = instancer.ComputeMaskAtTime(time)
    is_shown = np.asarray(mask, np.bool_) if len(mask) == len(numbers) else np.ones(len(numbers), np.bool_)
    is_shown &= np.isfinite(matrices).all(axis=(1, 2))
    for number, path in enumerate(targets):
        prototype = prim.GetStage().GetPrimAtPath(path)
        if prototype:
            yield prototype, matrices[is_shown & (numbers == number)]
    num_missing = int((is_shown & ((numbers < 0) | (numbers >= len(targets)))).sum())
    if num_missing:
        warnings.append(unsupported(f"Skipped {num_missing:,} instances of {label}: they have no prototype."))
