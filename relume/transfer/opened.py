"""A published store opened for freezing and frames."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume import environments
from relume.errors import ParameterError, StoreError
from relume.light.blur import blurred, reduced
from relume.light.environment import lookup, shrunk, turned
from relume.light.tiles import Tiles
from relume.light.triangles import TriangleLights, weigh
from relume.look import BAKED_ENVIRONMENT, EnvironmentKey, complete
from relume.store import open_store
from relume.transfer.base import StoreReader
from relume.transfer.derived import DerivedImages
from relume.transfer.gathered import CellLight
from relume.transfer.light import Light
from relume.transfer.local import LocalLights
from relume.transfer.reflected import Reflected
from relume.transfer.stored import read_cells, read_lights, read_tiles
from relume.transfer.view import View, open_view

_LIGHTS_KEPT = 4
_ROUGH_WIDTH = 512
_EDITED_BYTES = 256 << 20
_BLURS_KEPT = 16

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Transfer:
    """One bake; shared by all pictures of it.

    Attributes:
        key: path of the store; tells this bake's frozen operators from other bakes' in a shared cache.
        default_look: the complete look of the scene as it was imported.
        cells: gather cells, where light that surfaces reflect was baked.
    """

    key: str
    store: StoreReader
    scene_id: str
    method: str
    num_lights: int
    default_look: dict[str, Any]
    material_names: Sequence[str]
    cells: CellLight | None
    views: dict[str, View]

    @cached_property
    def derived(self) -> DerivedImages:
        """Images of the default look, made once."""
        return DerivedImages(Path(self.key) / "derived")

    @cached_property
    def edited(self) -> DerivedImages:
        """Those of other looks, the newest of them, for when the same look is opened after a restart."""
        return DerivedImages(Path(self.key) / "edited", _EDITED_BYTES)

    def has_image(self, key: Hashable) -> bool:
        """Whether the image of a term is beside the store, under the name of a `Need` without the store's own."""
        return self.derived.has(key) or self.edited.has(key)

    @cached_property
    def local(self) -> LocalLights:
        """What local lights need."""
        return LocalLights(self.store)

    @cached_property
    def lights(self) -> TriangleLights:
        """The environment's triangles."""
        return read_lights(self.store)

    @cached_property
    def _own_radiance(self) -> NDArray[np.float32]:
        return np.asarray(self.store.read("lights/environment"), np.float32)

    def radiance_of(self, name: str | None) -> NDArray[np.float32]:
        """Radiance of an environment, None for the scene's own. (height, width, 3) float32

        Raises:
            NotFoundError: it is not here. SceneError: its files are damaged.
        """
        return self._own_radiance if name is None else environments.find(name).radiance

    def lights_in(self, environment: EnvironmentKey) -> TriangleLights:
        """The triangles of an environment: the tiles of the bake, weighed again."""
        return self.lights if environment == BAKED_ENVIRONMENT else self._weighed(environment)

    def lights_of(self, light: Light) -> TriangleLights:
        """Those of them by which light comes straight to the picture."""
        return _shown(self.lights_in(light.environment), light)

    def rough_lights_of(self, light: Light) -> TriangleLights:
        """The same from a map of at most 512 texels' width: weighing a large one takes seconds."""
        return _shown(self._roughly_weighed(light.environment), light)

    @cached_property
    def _roughly_weighed(self) -> Callable[[EnvironmentKey], TriangleLights]:
        def weighed(key: EnvironmentKey) -> TriangleLights:
            return weigh(self._tiles, self._rough_radiance(key.map), key.rotation)

        return lru_cache(maxsize=_LIGHTS_KEPT)(weighed)

    @cached_property
    def _rough_radiance(self) -> Callable[[str | None], NDArray[np.float32]]:
        return lru_cache(maxsize=_LIGHTS_KEPT)(lambda name: shrunk(self.radiance_of(name), _ROUGH_WIDTH))

    @cached_property
    def _tiles(self) -> Tiles:
        return read_tiles(self.store)

    @cached_property
    def _weighed(self) -> Callable[[EnvironmentKey], TriangleLights]:
        return lru_cache(maxsize=_LIGHTS_KEPT)(lambda key: weigh(self._tiles, self.radiance_of(key.map), key.rotation))

    @cached_property
    def reflected(self) -> Reflected | None:
        """Light that gather cells send out; None where it was not baked."""
        cells = self.cells
        if cells is None:
            return None
        of_environment = lru_cache(maxsize=_LIGHTS_KEPT)(lambda key: cells.irradiance(self.lights_in(key)))

        def irradiance(light: Light, roughly: bool) -> NDArray[np.float32]:
            of_local = self.local.rough_irradiance if roughly else self.local.irradiance
            arriving = np.zeros((cells.num_cells, 3), np.float32)
            if light.is_environment_lit:
                arriving += np.array(light.environment_gain, np.float32) * of_environment(light.environment)
            for geometry, gain in light.local:
                arriving += np.array(gain, np.float32) * of_local(geometry)[:, None]
            return arriving

        return Reflected(cells, irradiance)

    def reflected_in(self, light: Light) -> NDArray[np.float32] | None:
        """Radiance of the gather cells; None where they send nothing to the picture."""
        return self.reflected.under(light) if self.reflected is not None and light.paths.reflect else None

    def background_in(self, environment: EnvironmentKey, view: View) -> NDArray[np.float32]:
        """Radiance of a view's samples of an environment. (n, 3) float32"""
        if environment == BAKED_ENVIRONMENT:
            return view.background()
        return self.seen_in(environment, view.background_directions())

    def seen_in(self, environment: EnvironmentKey, directions: NDArray[np.float64], blur: float = 0) -> F32:
        """Radiance of an environment in unit directions, blurred by so many degrees. (n, 3) float32"""
        name = environment.map
        radiance = self._blurred(name, blur) if blur else self.radiance_of(name)
        return lookup(radiance, turned(directions, -environment.rotation).astype(np.float32))

    @cached_property
    def _blurred(self) -> Callable[[str | None, float], F32]:
        few = lru_cache(maxsize=_LIGHTS_KEPT)(lambda name: reduced(self.radiance_of(name)))
        return lru_cache(maxsize=_BLURS_KEPT)(lambda name, degrees: blurred(few(name), degrees))


def _shown(lights: TriangleLights, light: Light) -> TriangleLights:
    """The triangles of an environment by which light comes straight to the picture, beside local lights."""
    if not (light.paths.direct and light.is_environment_lit):
        return lights.none()
    if light.environment_gain == (1.0, 1.0, 1.0):
        return lights
    return replace(lights, power=lights.power * np.array(light.environment_gain, np.float32))


def open_transfer(path: Path) -> Transfer:
    """Open a published store.

    Raises:
        StoreNotFoundError, SchemaVersionError, ChunkDamagedError, StoreError: see `relume.store.open_store`.
    """
    store = open_store(path)
    found = store.attributes
    try:
        return Transfer(
            key=str(path.resolve()),
            store=store,
            scene_id=found["scene"],
            method=found["method"],
            num_lights=found["num_lights"],
            default_look=complete({}, found["look"]),
            material_names=tuple(found["materials"]),
            cells=read_cells(store) if "gather_rays" in found else None,
            views={view["name"]: open_view(store, k) for k, view in enumerate(found["views"])},
        )
    except (KeyError, TypeError, IndexError, ParameterError) as error:
        raise StoreError(
            f"the store's description is not of this form ({error}); delete the bake, bake again"
        ) from error
