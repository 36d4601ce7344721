"""Bidirectional texture functions: one BRDF per texel, with cosine, compressed by local PCA (Müller et al. 2004).

Read first: `local_pca_btf`, `compress`.
"""
