"""User images that replace a material's own maps: texture, roughness, metalness or normal map, "image:<id>"."""
