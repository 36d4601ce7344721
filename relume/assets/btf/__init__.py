"""Bidirectional texture functions: one BRDF per texel, with cosine, compressed by local PCA.

Read first: `local_pca_btf`, `compress` (two coders; that of whole BRDFs is Müller et al. 2004's).
"""
