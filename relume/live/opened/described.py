"""Fields of opened bakes, from the attributes of a store."""

from __future__ import annotations

from typing import Any

from relume.core.cache import Cache
from relume.core.errors import ParameterError, StoreError
from relume.look import complete
from relume.store.bake_protocol import StoreReader
from relume.views.view import open_view


def read_fields(store: StoreReader, key: str, cache: Cache) -> dict[str, Any]:
    """Read the fields of `BakedFixedViews` from a store.

    Args:
        store: an open store. key: of the bake in the cache. cache: of results computed from the bake.
    Raises:
        StoreError: its description is invalid. ChunkDamagedError: its arrays do not match.
    """
    fields = read_light_fields(store, key, cache)
    views = (open_view(store, k, cache, key) for k in range(len(store.attributes["views"])))
    return {**fields, "views": {view.name: view for view in views}}


def read_light_fields(store: StoreReader, key: str, cache: Cache) -> dict[str, Any]:
    """Read the fields that do not depend on views.

    Args:
        store: an open store. key: of the bake in the cache. cache: of results computed from the bake.
    Raises:
        StoreError: its description is invalid.
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
        raise StoreError(f"the store's description is invalid ({error}); delete the bake and bake again") from error
