"""Pictures as files: EXR keeps linear radiance, PNG and WebP hold what the screen shows."""

from relume.imageio.files import png_bytes, to_bytes, write_image
from relume.imageio.shrink import shrink
from relume.imageio.tonemap import tone_map

__all__ = ["png_bytes", "shrink", "to_bytes", "tone_map", "write_image"]
