"""Surface probes: their density and placement, and the lattice of nodes that interpolates between them.

Read first: `mesh_lattice`, `triangle_grids`.
"""
