"""Import of USD files from untrusted sources, by usd-core: `.usd`, `.usda`, `.usdc` and `.usdz`.

`layers` opens the stage in a private folder, `stage_reader` walks its prims, `meshes` and `shapes` make triangles, and
`bound_materials` makes materials of shader networks, by `relume.scene_io.surfaces`.
"""

from relume.scene_io.usd.stage_reader import import_usd

__all__ = ["import_usd"]
