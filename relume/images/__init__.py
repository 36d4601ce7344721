"""Images that looks may name in the place of a material's own: a term's `texture` or `roughness_map`, a
material's `normal_map`; "image:<id>"."""
