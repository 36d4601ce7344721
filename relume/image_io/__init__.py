"""Image files: decoding with limits, EXR of linear radiance, display images as PNG and WebP."""
