"""OpenEXR files of all layouts for tests."""

import struct

import numpy as np
import OpenImageIO as oiio  # noqa: N813


def exr_part(channels, size=None, **attributes):
    """Header and channels of a part.

    Args:
        channels: arrays by name, (height, width). size: of the display window, by default that of the channels, and its
            corner relative to that of the pixels: (width, height, x, y).
        attributes: `tiles`, a tuple, `compression`, `name`, or any attribute of numbers.
    """
    planes = list(channels.values())
    height, width = planes[0].shape
    spec = oiio.ImageSpec(width, height, len(planes), oiio.HALF if planes[0].dtype == np.float16 else oiio.FLOAT)
    spec.channelnames = list(channels)
    if size is not None:
        spec.full_width, spec.full_height, spec.full_x, spec.full_y = size
    if "tiles" in attributes:
        spec.tile_width, spec.tile_height = attributes.pop("tiles")
    if "name" in attributes:
        spec.attribute("oiio:subimagename", attributes.pop("name"))
    for name, value in attributes.items():
        if isinstance(value, tuple):
            spec.attribute(name, oiio.TypeDesc(f"float[{len(value)}]"), value)
        else:
            spec.attribute(name, value)
    return spec, np.stack(planes, axis=-1)


def write_exr(path, *parts):
    """Write parts made by `exr_part`; return the bytes."""
    output = oiio.ImageOutput.create(str(path))
    specs = [spec for spec, _ in parts]
    assert output.open(str(path), specs if len(specs) > 1 else specs[0]), output.geterror()
    for index, (spec, pixels) in enumerate(parts):
        assert index == 0 or output.open(str(path), spec, "AppendSubimage"), output.geterror()
        assert output.write_image(pixels), output.geterror()
    output.close()
    return path.read_bytes()


def exr_attribute(name, kind, value):
    """An attribute of a header; `kind`: its type, `value`: its bytes."""
    return f"{name}\0{kind}\0".encode() + struct.pack("<I", len(value)) + value


def required_attributes(width, height, channels, compression):
    """The attributes that each file has.

    Args:
        width, height: of both windows. channels: of halves: the distance between their pixels, by name.
        compression: its byte.
    """
    listed = b"".join(name.encode() + b"\0" + struct.pack("<4I", 1, 0, step, step) for name, step in channels.items())
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    return b"".join(
        [
            exr_attribute("channels", "chlist", listed + b"\0"),
            exr_attribute("compression", "compression", compression),
            exr_attribute("dataWindow", "box2i", window),
            exr_attribute("displayWindow", "box2i", window),
            exr_attribute("lineOrder", "lineOrder", b"\0"),
            exr_attribute("pixelAspectRatio", "float", struct.pack("<f", 1)),
            exr_attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
            exr_attribute("screenWindowWidth", "float", struct.pack("<f", 1)),
        ]
    )


def luminance_chroma_exr(rgb, weights):
    """An uncompressed file with the channels Y, RY and BY (ImfRgbaYca.h), the latter two for every other pixel.

    Args:
        rgb: (height, width, 3), even. weights: of red, green and blue in the luminance.
    """
    y = rgb @ np.asarray(weights)
    planes = {"BY": ((rgb[..., 2] - y) / y)[::2, ::2], "RY": ((rgb[..., 0] - y) / y)[::2, ::2], "Y": y}
    height, width = y.shape

    channels = {name: width // plane.shape[1] for name, plane in planes.items()}
    header = b"\x76\x2f\x31\x01\x02\0\0\0" + required_attributes(width, height, channels, b"\0") + b"\0"
    lines = [
        b"".join(
            p[row * len(p) // height].astype("<f2").tobytes() for p in planes.values() if row % (height // len(p)) == 0
        )
        for row in range(height)
    ]
    first = len(header) + 8 * height
    offsets = np.cumsum([first] + [8 + len(line) for line in lines])[:-1].astype("<u8").tobytes()
    return header + offsets + b"".join(struct.pack("<iI", row, len(line)) + line for row, line in enumerate(lines))
