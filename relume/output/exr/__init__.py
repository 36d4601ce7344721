"""OpenEXR for compositing: linear radiance, one layer a light and a kind of light path, and provenance."""
