"""Import of Wavefront OBJ, Stanford PLY and STL from untrusted files."""

from relume.scene_io.obj_ply.importer import import_obj, import_ply, import_stl
from relume.scene_io.obj_ply.stl import is_stl

__all__ = ["import_obj", "import_ply", "import_stl", "is_stl"]
