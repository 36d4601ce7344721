"""Where an eye rests: few exact samples, then an exact picture of that place, take the place of the moving one."""
