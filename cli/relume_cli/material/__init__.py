"""`relume material`: measured materials and BTFs."""
