"""Import of glTF 2.0 from untrusted files."""

from relume.scene_io.gltf.importer import import_gltf

__all__ = ["import_gltf"]
