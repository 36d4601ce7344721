"""A zip of images like those of the Bonn measurements, with ten directions."""

import io
import zipfile

import numpy as np
from PIL import Image

from relume.core.color import srgb_encode

DIRECTIONS = [(0, 0), *((40, phi) for phi in (0, 90, 180, 270)), *((70, phi) for phi in (0, 72, 144, 216, 288))]


def make_image(view, light, size=(6, 5), kind="PNG"):
    """An image that encodes its light and view direction."""
    value = 0.05 + 0.07 * DIRECTIONS.index(view) + 0.02 * DIRECTIONS.index(light)
    row, column = np.mgrid[: size[0], : size[1]]
    linear = np.clip(value * (1 + 0.3 * np.sin(row + 2 * column))[..., None] * [1, 0.8, 0.6], 0, 1).astype(np.float32)
    file = io.BytesIO()
    Image.fromarray(np.rint(255 * srgb_encode(linear)).astype(np.uint8)).save(file, kind)
    return file.getvalue(), linear


def make_image_name(view, light, number=0):
    return f"tv{view[0]:03}/{number:05} tl{light[0]:03} pl{light[1]:03} tv{view[0]:03} pv{view[1]:03}.png"


def zipped(path, change=lambda files: None):
    files = {make_image_name(view, light): make_image(view, light)[0] for view in DIRECTIONS for light in DIRECTIONS}
    files["readme.txt"] = b"measured by nobody"
    change(files)
    with zipfile.ZipFile(path, "w") as file:
        for name, content in files.items():
            file.writestr(name, content)
    return path
