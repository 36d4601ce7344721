"""Ray tracing with Embree: packets, visibility bits, surface interaction, textures, alpha testing.

Read first: `scene_buffers`, `visibility_masks`.
"""
