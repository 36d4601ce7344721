"""What a store says of itself, as the fields of opened bakes."""

from __future__ import annotations

from typing import Any

from relume.bake import StoreReader
from relume.errors import ParameterError, StoreError
from relume.look import complete
from relume.memory import Memory
from relume.views.view import open_view


def described(store: StoreReader, key: str, memory: Memory) -> dict[str, Any]:
    """The fields of `BakedViews` as a store has them.

    Args:
        store: an open one. key: of the bake in the memory. memory: of all that is made from the bake.
    Raises:
        StoreError: its description is not of this form. ChunkDamagedError: its arrays do not fit each other.
    """
    fields = described_light(store, key, memory)
    views = (open_view(store, k, memory, key) for k in range(len(store.attributes["views"])))
    return {**fields, "views": {view.name: view for view in views}}


def described_light(store: StoreReader, key: str, memory: Memory) -> dict[str, Any]:
    """Those of them that light needs: no views.

    Args:
        store: an open one. key: of the bake in the memory. memory: of all that is made from the bake.
    Raises:
        StoreError: its description is not of this form.
    """
    found = store.attributes
    try:
        return {
            "memory": memory,
            "key": key,
            "store": store,
            "scene_id": found["scene"],
            "method": found["method"],
            "num_lights": found["num_lights"],
            "default_look": complete({}, found["look"]),
            "material_names": tuple(found["materials"]),
            "views": {},
        }
    except (KeyError, TypeError, IndexError, ParameterError) as error:
        raise StoreError(
            f"the store's description is not of this form ({error}); delete the bake, bake again"
        ) from error
