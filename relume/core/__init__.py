"""Shared foundations: errors, validation, the cache, thread pools, files, hashes of sources, Numba options.

Imports no other package of relume. Read first: `errors`, `cache`.
"""
