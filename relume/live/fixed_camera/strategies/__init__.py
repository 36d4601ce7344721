"""Update strategies of a term's image, from a cached image to shading anew; one a file.

Read first: `base`.
"""
