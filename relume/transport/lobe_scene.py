"""Surfaces that lobe rays meet, with their light, for callers that do not keep hits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.scene_buffers import SceneBuffers
from relume.transport.hit_textures import TexturedLight
from relume.transport.lobe_paths import LobeSurfaces
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.patch_lookup import PatchLookup


class LobeScene(NamedTuple):
    """A scene as lobe rays see it, under one light.

    Attributes:
        geometry: triangles. lookup: finds patches. surfaces: that rays go on from.
        outgoing: outgoing radiance of the patches. textured: its isotropic part, by the textures at a hit.
        broad_share: share of each patch's isotropic radiance that its narrow lobe does not reflect.
        emission: radiance of each material's surfaces, which surfaces with narrow lobes reflect; empty for none.
    """

    geometry: SceneBuffers
    lookup: PatchLookup
    surfaces: LobeSurfaces
    outgoing: OutgoingLight
    textured: TexturedLight
    broad_share: Shaped[NDArray[np.float32], " patches"]
    emission: Shaped[NDArray[np.float32], "materials 3"]
