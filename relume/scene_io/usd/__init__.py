"""Import of USD files from untrusted sources, by usd-core: `.usd`, `.usda`, `.usdc` and `.usdz`.

`layers` opens the stage in a private folder, `stage_reader` walks its prims, `meshes` and `shapes` make triangles, and
`bound_materials` converts shader networks to the glTF material that `relume.scene_io.gltf.materials` reads.
"""

from relume.scene_io.usd.stage_reader import import_usd

__all__ = ["import_usd"]
