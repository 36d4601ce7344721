"""Environment files for tests."""

import numpy as np
import OpenImageIO
from tiny_scenes import studio


def dusk():
    """Radiance unlike the studio's: from the other side, and red. (32, 64, 3)"""
    return np.ascontiguousarray(np.roll(studio(32), 25, axis=1) * [1.0, 0.4, 0.2], np.float32)


def write_map(path, pixels, chromaticities=None, **attributes):
    """Write an equirectangular image in the format of the file name; `chromaticities`: 8 numbers."""
    height, width, channels = pixels.shape
    output = OpenImageIO.ImageOutput.create(str(path))
    spec = OpenImageIO.ImageSpec(width, height, channels, OpenImageIO.FLOAT)
    if chromaticities is not None:
        spec.attribute("chromaticities", OpenImageIO.TypeDesc("float[8]"), tuple(chromaticities))
    for name, value in attributes.items():
        spec.attribute(name, value)
    assert output.open(str(path), spec)
    assert output.write_image(np.ascontiguousarray(pixels, np.float32))
    output.close()
    return path
