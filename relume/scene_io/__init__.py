"""Import of glTF, OBJ and PLY scenes; untrusted files are checked before memory is allocated."""
