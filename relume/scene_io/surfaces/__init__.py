"""Surface models of other formats as materials: OpenPBR, Standard Surface, glTF PBR and UsdPreviewSurface.

A model's inputs are constants and images (`surface_inputs`). Each model converts them to `surface_parameters`, which
are those of glTF with its extensions, and `make_material` makes a material of these.
"""
