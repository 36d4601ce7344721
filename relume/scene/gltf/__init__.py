"""Reading glTF 2.0, from files that nobody vouches for."""

from relume.scene.gltf.importer import import_gltf

__all__ = ["import_gltf"]
