"""Import of USD files from untrusted sources, by usd-core: `.usd`, `.usda`, `.usdc` and `.usdz`.

`layers` opens the stage in a private folder, `importer` walks its prims, `meshes` and `shapes` make triangles, and
`materials` converts shader networks to the glTF material that `relume.scene_io.gltf.materials` reads.
"""

from relume.scene_io.usd.importer import import_usd
from relume.scene_io.usd.layers import is_usd

__all__ = ["import_usd", "is_usd"]
