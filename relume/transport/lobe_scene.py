"""Surfaces that lobe rays meet, with their light, for callers that do not keep hits."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.look.model import Link
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.hit_textures import TexturedLight
from relume.transport.lobe_hits import LobeHits
from relume.transport.lobe_paths import LobeSurfaces
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.transport.patch_lookup import PatchLookup


class LobeLinks(Protocol):
    """Light that does not light all surfaces, as lobe rays see it."""

    @property
    def environment(self) -> Link | None:
        """The surfaces that the environment lights."""
        ...

    def darken(self, link: Link | None, points: SurfacePoints, *light: NDArray[Any]) -> None:
        """Set light of points to zero, in place, where a light with this link does not light the surface."""
        ...

    def lit_hits(self, hits: LobeHits, points: SurfacePoints) -> LobeHits:
        """Return hits without environment and emission that do not light the surface that reflects them.

        Args:
            hits: of the points' rays. points: where they start.
        """
        ...


class LobeScene(NamedTuple):
    """A scene as lobe rays see it, under one light.

    Attributes:
        geometry: triangles. lookup: finds patches. surfaces: that rays go on from.
        outgoing: outgoing radiance of the patches. textured: its isotropic part, by the textures at a hit.
        broad_share: share of each patch's isotropic radiance that its narrow lobe does not reflect.
        emission: radiance of each material's surfaces, which surfaces with narrow lobes reflect; empty for none.
        links: of the light.
    """

    geometry: SceneBuffers
    lookup: PatchLookup
    surfaces: LobeSurfaces
    outgoing: OutgoingLight
    textured: TexturedLight
    broad_share: Shaped[NDArray[np.float32], " patches"]
    emission: Shaped[NDArray[np.float32], "materials 3"]
    links: LobeLinks
