"""Assets that looks name: environments, measured materials, BTFs; each kind has a store of its own.

Read first: `asset_store`.
"""
