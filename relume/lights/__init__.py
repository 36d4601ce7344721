"""Light sources as light triangles: environments by spherical triangles, local lights, sun disks, moments.

Read first: `sphere_tiles`, `light_moments`, `local_lights`.
"""
