"""Images of opened bakes while looks change: `fixed_camera` (linear operators) and `free_camera` (surface probes)."""
