"""Surface patches, and the gather rays that hit them: final gathering (Nguyen et al. 2010).

Read first: `patches`, `patch_kdtree`.
"""
