"""A published store opened for freezing and frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from relume.errors import StoreError
from relume.light.triangles import TriangleLights
from relume.store import open_store
from relume.transfer.base import StoreReader
from relume.transfer.derived import DerivedImages
from relume.transfer.stored import read_lights
from relume.transfer.view import View, open_view


@dataclass(frozen=True)
class Transfer:
    """One bake; shared by all pictures of it.

    Attributes:
        key: path of the store; tells this bake's frozen operators from other bakes' in a shared cache.
        default_look: the complete look of the scene as it was imported.
    """

    key: str
    store: StoreReader
    scene_id: str
    method: str
    num_lights: int
    default_look: dict[str, Any]
    material_names: Sequence[str]
    views: dict[str, View]

    @cached_property
    def derived(self) -> DerivedImages:
        """Images of the default look, made once."""
        return DerivedImages(Path(self.key))

    @cached_property
    def lights(self) -> TriangleLights:
        """The environment's triangles."""
        return read_lights(self.store)


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
            default_look=found["look"],
            material_names=tuple(found["materials"]),
            views={view["name"]: open_view(store, k) for k, view in enumerate(found["views"])},
        )
    except (KeyError, TypeError, IndexError) as error:
        raise StoreError(
            f"the store's description is not of this form ({error}); delete the bake, bake again"
        ) from error
