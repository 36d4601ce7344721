"""Shared foundations: errors, validation, the cache, thread pools, files, source hashes, Numba options.

This package imports nothing else from relume. Start with `errors` and `cache`.
"""
