"""Views of stored samples: pixels, samples, maps and their overrides, the image of an array of samples.

Read first: `view`, `resolve`.
"""
