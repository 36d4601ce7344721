"""Surface probes: their placement, the lattice of interpolation nodes, map overrides."""
