"""Points on surfaces: where they are, what a mesh between them takes from them, textures."""
