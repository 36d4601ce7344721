"""View samples of a camera: primary hits, glass, planar mirrors, edges (Ben-Artzi et al. 2006, section 5).

Read first: `view_samples`, `camera_samples`.
"""
