"""Bidirectional texture functions (Müller 2004): a BRDF for each texel, its cosine included."""
