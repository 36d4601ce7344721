"""Shared foundations: errors, validation, the cache, thread pools, files, source hashes, Numba options.

Imports no other package of relume. Read first: `errors`, `cache`.
"""
