"""OpenEXR for compositing: linear radiance, layers per light and per light path, and provenance."""
