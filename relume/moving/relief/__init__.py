"""Surfaces whose every texel has a BRDF of its own, while the eye moves (Müller 2004)."""
