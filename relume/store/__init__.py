"""Transfer stores: chunked, checksummed Zarr v3 on disk; the bake protocol and its runner.

Read first: `schema`, `bake_protocol`.
"""

from relume.store.publish import publish
from relume.store.reader import Reader, open_staging, open_store, read_code
from relume.store.run_bake import bake_in_process
from relume.store.schema import SCHEMA_VERSION
from relume.store.writer import StoreWriter, create_store

__all__ = [
    "SCHEMA_VERSION",
    "Reader",
    "StoreWriter",
    "bake_in_process",
    "create_store",
    "open_staging",
    "open_store",
    "publish",
    "read_code",
]
