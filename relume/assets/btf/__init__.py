"""Bidirectional texture functions: one BRDF a texel, cosine included, compressed by local PCA (Müller et al. 2004).

Read first: `local_pca_btf`, `compress`.
"""
