"""Inverse lighting: the gains of lights from a target image (Schoeneman and others 1993, "Painting with Light").

An image is linear in the gains of its light sources, so the gains nearest to a target are a non-negative least-squares
problem over the images of single sources. Read first: `match_lights`, `solve`. Equations: docs/inverse-lighting.md.
"""
