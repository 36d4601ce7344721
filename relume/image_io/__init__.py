"""Images as files: decoding within bounds, EXR of linear radiance, display images as PNG and WebP."""
