"""Reading glTF 2.0, from files that nobody vouches for."""

from relume.scene_io.gltf.importer import import_gltf

__all__ = ["import_gltf"]
