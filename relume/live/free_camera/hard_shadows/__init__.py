"""Hard-shadow lights: sun disks and small lights whose shadows are traced per pixel."""
