"""Images that looks may name in the place of a material's own: a term's `texture`, "image:<id>"."""
