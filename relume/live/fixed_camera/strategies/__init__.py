"""Strategies that bring a term's image to its target, from a cached image to shading anew; one a file.

Read first: `strategy`, then the table in `table`.
"""
