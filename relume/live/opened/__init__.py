"""Opened bakes: the light of a look from the arrays of a store, for fixed and free cameras.

Read first: `openers`, then `fixed_views`.
"""
