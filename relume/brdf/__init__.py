"""BRDFs as sums of terms, each a product of a quotient and one-dimensional curves (Ben-Artzi et al. 2006, section 3).

Read first: `term`, `registry`, then a model in `terms`.
"""
