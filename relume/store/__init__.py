"""Transfer stores: chunked, checksummed Zarr v3 on disk; the bake protocol and its runner.

Read first: `schema`, `bake_protocol`.
"""
