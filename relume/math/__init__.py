"""Bases and factorizations: Zernike functions, spherical harmonics, wavelets, PCA, direction grids.

Ben-Artzi et al. 2006 (Daubechies wavelets), Sun et al. 2007 (Zernike basis), Müller et al. 2004 (local PCA).
Read first: `zernike`, `daubechies`.
"""
