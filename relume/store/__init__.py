"""Transfer stores: chunked, checksummed Zarr v3 on disk. See `relume.store.schema` for the layout."""

from relume.store.fill import bake_here
from relume.store.publish import publish
from relume.store.reader import Reader, code_of, open_staging, open_store
from relume.store.schema import SCHEMA_VERSION
from relume.store.writer import StoreWriter, create_store

__all__ = [
    "SCHEMA_VERSION",
    "Reader",
    "StoreWriter",
    "bake_here",
    "code_of",
    "create_store",
    "open_staging",
    "open_store",
    "publish",
]
