"""Hard-shadow lights: suns and small lights whose shadows each pixel traces itself."""
