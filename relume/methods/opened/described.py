"""What a store says of itself, as the fields of opened bakes."""

from __future__ import annotations

from typing import Any

from relume.core.cache import Cache
from relume.core.errors import ParameterError, StoreError
from relume.look import complete
from relume.store.bake_protocol import StoreReader
from relume.views.view import open_view


def read_fields(store: StoreReader, key: str, cache: Cache) -> dict[str, Any]:
    """The fields of `BakedFixedViews` as a store has them.

    Args:
        store: an open one. key: of the bake in the memory. cache: of all that is made from the bake.
    Raises:
        StoreError: its description is not of this form. ChunkDamagedError: its arrays do not fit each other.
    """
    fields = read_light_fields(store, key, cache)
    views = (open_view(store, k, cache, key) for k in range(len(store.attributes["views"])))
    return {**fields, "views": {view.name: view for view in views}}


def read_light_fields(store: StoreReader, key: str, cache: Cache) -> dict[str, Any]:
    """Those of them that light needs: no views.

    Args:
        store: an open one. key: of the bake in the memory. cache: of all that is made from the bake.
    Raises:
        StoreError: its description is not of this form.
    """
    attributes = store.attributes
    try:
        return {
            "cache": cache,
            "key": key,
            "store": store,
            "scene_id": attributes["scene"],
            "method": attributes["method"],
            "num_lights": attributes["num_lights"],
            "default_look": complete({}, attributes["look"]),
            "material_names": tuple(attributes["materials"]),
            "views": {},
        }
    except (KeyError, TypeError, IndexError, ParameterError) as error:
        raise StoreError(
            f"the store's description is not of this form ({error}); delete the bake, bake again"
        ) from error
