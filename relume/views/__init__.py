"""Views of stored samples: pixels, samples, maps and their overrides, the image from an array of samples.

Read first: `view`, `resolve`.
"""
