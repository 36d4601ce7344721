"""Decodes what meshoptimizer packs for glTF, extensions EXT_meshopt_compression and KHR_meshopt_compression.

Written after the specification of the extensions, appendix A (bit streams) and B (filters). Nothing here reads beyond
what it is given, or makes more than was asked for.
"""

from relume.scene_io.meshopt.errors import MeshoptError
from relume.scene_io.meshopt.filters import FILTERS
from relume.scene_io.meshopt.indices import decode_sequence, decode_triangles
from relume.scene_io.meshopt.vertices import decode_vertices

__all__ = ["FILTERS", "MeshoptError", "decode_sequence", "decode_triangles", "decode_vertices"]
