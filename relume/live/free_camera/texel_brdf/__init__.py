"""BTF-textured surfaces under a free camera: per-texel shading (Müller et al. 2004)."""
