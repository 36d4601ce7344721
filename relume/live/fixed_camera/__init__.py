"""Images of fixed cameras, updated incrementally (Ben-Artzi et al. 2006, section 6).

A scheduler chooses among `strategies` from a cached image to shading anew. Read first: `picture`, `jobs`.
"""
