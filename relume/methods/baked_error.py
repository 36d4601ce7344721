"""The error of free-camera images that a bake has measured, in the layout of a store."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from relume.core.jackknife import JackknifeEstimate
from relume.store.bake_protocol import StoreReader

FREE_CAMERA_ERROR = "error/free_camera"


class BakedError(NamedTuple):
    """Error of free-camera images, estimated by a bake in the scene's default look.

    Attributes:
        delta_e, rms: as in `relume.live.fixed_camera.fidelity.ImageError`.
    """

    delta_e: JackknifeEstimate
    rms: JackknifeEstimate


def read_free_camera_error(store: StoreReader) -> BakedError | None:
    """Read the error of free-camera images; None if unknown, as for bakes of earlier versions."""
    if not store.attributes.get("has_free_camera_error") or store.shape(FREE_CAMERA_ERROR) != (2, 2):
        return None
    estimates = store.read(FREE_CAMERA_ERROR)
    if not np.isfinite(estimates).all():
        return None
    return BakedError(*(JackknifeEstimate(*row) for row in estimates.tolist()))
