"""Bake methods, direct, gather and surface: what each plans, computes and stores.

Read first: `base`, then `direct`.
"""
