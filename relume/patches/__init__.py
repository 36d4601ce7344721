"""Surface patches and the hits of gather rays on them (Nguyen et al. 2010).

Read first: `patches`, `patch_kdtree`.
"""
