"""Precomputed wavelet linear operators: images as linear functions of a curve or a parameter, and R += T Δc.

Ben-Artzi et al. 2006, sections 4 and 6. Read first: `linear_operator`, `update_kernel`.
"""
