"""What looks may name: materials of the library, measured ones, textures from all sides, environments, images."""
