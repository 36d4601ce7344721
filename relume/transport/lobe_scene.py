"""Surfaces that lobe rays meet, with their light, for callers that do not keep hits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.scene_buffers import SceneBuffers
from relume.transport.lobe_paths import LobeSurfaces
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.patch_lookup import PatchLookup


class LobeScene(NamedTuple):
    """A scene as lobe rays see it, under one light.

    Attributes:
        geometry: triangles. lookup: finds patches. surfaces: that rays go on from.
        outgoing: outgoing radiance of the patches.
        broad_share: share of each patch's isotropic radiance that its narrow lobe does not reflect.
    """

    geometry: SceneBuffers
    lookup: PatchLookup
    surfaces: LobeSurfaces
    outgoing: OutgoingLight
    broad_share: Shaped[NDArray[np.float32], " patches"]
