"""Scene files read: glTF, OBJ and PLY; untrusted, bounded before they are allocated."""
