"""Shading of light lists by prefiltered (box) table lookup, in groups of lights."""
