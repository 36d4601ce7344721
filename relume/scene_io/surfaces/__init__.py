"""Surface models as materials: OpenPBR, Standard Surface, glTF PBR and UsdPreviewSurface; and glTF's materials.

`node_values` reads networks of MaterialX and USD into constants and images (`surface_inputs`). Each of the `models`
converts them to `surface_parameters`, which are those of glTF with its extensions; `make_material`, to read first,
makes a material of these, and `to_terms` its terms.
"""
