"""Projection of light at points onto curves: the integral of light times BRDF (Ben-Artzi et al. 2006, equation 7).

Read first: `shading_points`, `projector`.
"""
