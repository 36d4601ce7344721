"""OpenEXR files for compositing: linear radiance, one layer for each light and each kind of light path, and where the
picture comes from."""
