"""Images that looks may name in the place of a material's own: a term's `texture` or `roughness_map`, "image:<id>"."""
