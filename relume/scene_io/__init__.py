"""Import of glTF, OBJ, PLY and STL scenes; untrusted files are checked before memory is allocated."""
