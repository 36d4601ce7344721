"""Assets that looks refer to: environments, measured materials, BTFs; each kind has its own store.

Read first: `asset_store`.
"""
