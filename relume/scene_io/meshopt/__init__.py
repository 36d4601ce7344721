"""Decoder of meshoptimizer's glTF compression, EXT_meshopt_compression and KHR_meshopt_compression.

Follows appendices A (bit streams) and B (filters) of the specification. Reads stay within the input, and output within
the requested size.
"""

from relume.scene_io.meshopt.errors import MeshoptError
from relume.scene_io.meshopt.filters import FILTERS
from relume.scene_io.meshopt.indices import decode_sequence, decode_triangles
from relume.scene_io.meshopt.vertices import decode_vertices

__all__ = ["FILTERS", "MeshoptError", "decode_sequence", "decode_triangles", "decode_vertices"]
