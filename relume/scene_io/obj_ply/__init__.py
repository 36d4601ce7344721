"""Import of Wavefront OBJ and Stanford PLY from untrusted files."""

from relume.scene_io.obj_ply.importer import import_obj, import_ply

__all__ = ["import_obj", "import_ply"]
