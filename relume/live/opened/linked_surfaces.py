"""Light linking: the surfaces that a light lights, and those that cast its shadows.

    E(x) = l(x) Σ_k V'_k w_k cos θi,k

l(x) is 1 on linked surfaces, else 0; V' is the visibility among the surfaces that cast shadows of this light. Indirect
light follows, because patches receive light in the same way.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.core.errors import Description, StoreError
from relume.core.validation import invalid_value, names_text
from relume.live.fixed_camera.illumination import Illumination
from relume.look.model import ExcludeLink, Link, SurfaceNames
from relume.raytrace.alpha_filter import STOP_AT_PARTIAL
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.embree import OMITTED_VERTEX, EmbreeScene
from relume.raytrace.surface_points import SurfacePoints
from relume.store.bake_protocol import StoreReader
from relume.transport.lobe_hits import LobeHits
from relume.transport.lobe_paths import END, NO_EMITTER

F32 = NDArray[np.float32]
Mask = NDArray[np.bool_]

_ACCELERATION_BYTES = 300  # of a triangle


@dataclass(frozen=True)
class _Casters:
    """Some triangles of a scene, an entry of the cache."""

    embree: EmbreeScene
    num_bytes: int


class LinkedSurfaces:
    """Meshes of a store by the names in links.

    Args:
        store: of the bake. positions, faces, embree: its triangles, all of them.
        cache: cache of results computed from the bake. key: key of the bake in it.
    """

    def __init__(
        self,
        store: StoreReader,
        positions: Shaped[F32, "vertices 3"],
        faces: Shaped[NDArray[np.uint32], "triangles 3"],
        embree: EmbreeScene,
        cache: Cache,
        key: str,
    ) -> None:
        self._store, self._cache, self._key = store, cache, key
        self._positions, self._faces, self._embree = positions, faces, embree

    @cached_property
    def _face_mesh(self) -> Shaped[NDArray[np.int32], " triangles"]:
        return np.asarray(self._store.read("scene/face_mesh"), np.int32)

    @cached_property
    def _mesh_material(self) -> Shaped[NDArray[np.int32], " meshes"]:
        """Material of each mesh; −1 for a mesh without triangles."""
        num_meshes = max(len(self._object_names), int(self._face_mesh.max(initial=-1)) + 1)
        material = np.full(num_meshes, -1, np.int32)
        material[self._face_mesh] = self._store.read("scene/face_material")
        return material

    @property
    def _object_names(self) -> list[str]:
        """Names of the meshes; empty for a store that lacks them."""
        return list(self._store.attributes.get("objects", ()))

    def check(self, links: Iterable[Link]) -> None:
        """Require that the objects of all links are in the scene.

        Raises:
            ParameterError: some are not. StoreError: the bake is too old for links of objects.
        """
        names = [_names(link) for link in links]
        linked = {name for each in names for name in each.objects}
        if linked and not self._object_names:
            raise StoreError("this bake is too old for links of objects; bake the scene again, or link materials")
        if missing := linked - set(self._object_names):
            allowed = f"objects of this scene: {names_text(self._object_names)}"
            raise invalid_value(("lights",), Description(f"links of {names_text(missing)}"), allowed)

    def _meshes(self, link: Link) -> Shaped[Mask, " meshes"]:
        self.check([link])
        names, materials = _names(link), self._store.attributes["materials"]
        named = np.isin(self._mesh_material, [k for k, name in enumerate(materials) if name in names.materials])
        objects = set(names.objects)
        named[: len(self._object_names)] |= np.array([name in objects for name in self._object_names], np.bool_)
        return ~named if isinstance(link, ExcludeLink) else named

    def faces(self, link: Link) -> Shaped[Mask, " triangles"]:
        """True for the triangles that a link names. Raises as `check` does."""
        return self._meshes(link)[self._face_mesh]

    def is_lit(
        self, link: Link | None, position: Shaped[F32, "n 3"], outward: Shaped[F32, "n 3"]
    ) -> Shaped[Mask, " n"]:
        """True for points on surfaces that a light with this link lights.

        Args:
            link: of the light. position: of the points, offset from their surface. outward: directions away from it.
        """
        if link is None:
            return np.ones(len(position), np.bool_)
        face = trace_rays(self._embree, position, -outward, STOP_AT_PARTIAL).face
        return (face >= 0) & self.faces(link)[face]

    def darken(self, link: Link | None, points: SurfacePoints, *light: NDArray[Any]) -> None:
        """Set light of points to zero, in place, where a light with this link does not light the surface."""
        if link is not None:
            is_dark = ~self.is_lit(link, points.position, points.normal)
            for values in light:
                values[is_dark] = 0

    def casters(self, shadow_link: Link | None) -> EmbreeScene:
        """Return the triangles that cast the shadows of a light."""
        if shadow_link is None:
            return self._embree
        num_bytes = _ACCELERATION_BYTES * len(self._faces)

        def build() -> _Casters:
            faces = np.where(self.faces(shadow_link)[:, None], self._faces, OMITTED_VERTEX)
            return _Casters(EmbreeScene.build(self._positions, faces, self._embree.alpha_test), num_bytes)

        key = self._key, "casters", shadow_link
        return self._cache.transient.get(key, _Casters, num_bytes, build).embree


@dataclass(frozen=True)
class LightLinks:
    """Links of the light of an image; `relume.transport.lobe_scene.LobeLinks`.

    Attributes:
        linked: the surfaces. light: the illumination. materials: names of the materials.
    """

    linked: LinkedSurfaces
    light: Illumination
    materials: Sequence[str]

    @property
    def environment(self) -> Link | None:
        """The surfaces that the environment lights."""
        return self.light.environment.link

    def darken(self, link: Link | None, points: SurfacePoints, *light: NDArray[Any]) -> None:
        """See `LinkedSurfaces.darken`."""
        self.linked.darken(link, points, *light)

    def lit_hits(self, hits: LobeHits, points: SurfacePoints) -> LobeHits:
        """Return hits without environment and emission that do not light the surface that reflects them."""
        escapes, paths = hits.escapes, hits.paths
        if self.environment is not None:
            escapes, throughput = escapes.copy(), paths.throughput.copy()
            self.darken(self.environment, points, escapes)
            is_lit = self.linked.is_lit(self.environment, points.position, points.normal)
            is_lit_entry = np.where(
                paths.face < 0, np.repeat(is_lit, np.diff(paths.first)), self.linked.faces(self.environment)[paths.face]
            )
            throughput[~is_lit_entry & (paths.kind != END)] = 0
            paths = paths._replace(throughput=throughput)
        for geometry, _ in self.light.local:
            if geometry.material_emissions and geometry.link is not None:
                emitters = [self.materials.index(material) for material, _ in geometry.material_emissions]
                emits = np.isin(paths.emitter, emitters)
                is_dark = emits & ~self.linked.faces(geometry.link)[paths.face]
                paths = paths._replace(emitter=np.where(is_dark, NO_EMITTER, paths.emitter))
        return replace(hits, escapes=escapes, paths=paths)


def _names(link: Link) -> SurfaceNames:
    return link.exclude if isinstance(link, ExcludeLink) else link.include
