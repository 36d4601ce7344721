"""Transfer methods `direct`, `gather` and `probes`: plan, bake and open.

Read first: `base`, then `direct`.
"""
