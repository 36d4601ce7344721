"""Output: rendered images, display encoding, EXR layers, material previews.

Read first: `render_image`.
"""
