"""`relume material`: measured materials, and textures that look different from every side."""
