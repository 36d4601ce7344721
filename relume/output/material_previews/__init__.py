"""Material previews: spheres in fixed lighting, and the atlas of the library."""
