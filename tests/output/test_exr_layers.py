"""Layers of an exported image sum to it: those of lights, and those of light paths."""

from __future__ import annotations

import numpy as np
import OpenImageIO
import pytest
from exact_pictures import open_copy
from session_edits import make_look

from relume.output.exr.export import export_exr
from relume.output.exr.layers import make_layers
from relume.output.render_image import render_image

LIGHTS = {
    "Key": {"kind": "point", "position": [0.5, 1.3, 0.5], "emission": [2.0, 1.5, 1.0]},
    "Fill": {
        "kind": "rectangle", "position": [0.9, 1.2, 0.9], "direction": [-1, -1, -1], "size": [0.5, 0.3],
        "emission": [1.0, 2.0, 4.0],
    },
}  # fmt: skip


@pytest.mark.parametrize("background", ["map", "color"])
def test_layers_of_lights_and_of_paths_each_sum_to_the_picture(gathered, tmp_path, background):
    layers, channel = exported(gathered, tmp_path, background, True)
    lights, paths = ([layer.name for layer in layers if layer.name.startswith(group)] for group in ("light_", "path_"))
    assert (len(lights), len(paths)) == (3 + (background == "color"), 3)
    assert_sum(channel, lights)
    assert_sum(channel, paths)


def test_light_groups_sum_to_the_picture(gathered, tmp_path):
    layers, channel = exported(gathered, tmp_path, "color", "light_groups")
    names = [layer.name for layer in layers]
    groups = {f"light_{light}_{kind}" for light in ("environment", "Key", "Fill") for kind in ("direct", "indirect")}
    assert set(names) == {"light_background", *groups}
    assert_sum(channel, names)


def exported(transfer, folder, background, layering):
    """The layers of an image under three lights, and the channels of its file by name."""

    def change(document):
        document["lights"].update(LIGHTS)
        document["environment"].update(intensity=0.7, rotation=30.0)
        document["background"].update(kind=background, color=[0.2, 0.3, 0.1])

    look = make_look(transfer, change)
    layers = make_layers(layering, look, has_indirect=True)
    fractions: list[float] = []
    path = folder / "a.exr"
    with open_copy(transfer) as other:  # one copy for all layers, as in a server
        export_exr(
            path, lambda edited, progress: render_image(other, "front", edited, progress=progress), look, layers, {},
            progress=fractions.append,
        )  # fmt: skip
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    buffer = OpenImageIO.ImageBuf(str(path))
    pixels, names = buffer.get_pixels(OpenImageIO.FLOAT), buffer.spec().channelnames
    return layers, {name: pixels[..., k] for k, name in enumerate(names)}


def assert_sum(channel, names):
    """Values are rounded to 11 bits, the smallest halves to 2^-25; no layer is black."""
    assert min(max(channel[f"{name}.{c}"].max() for c in "RGB") for name in names) > 0.003
    for c in "RGB":
        parts = np.array([channel[f"{name}.{c}"] for name in names])
        allowed = 2**-11 * (channel[c] + parts.sum(axis=0)) + 2**-23
        np.testing.assert_array_less(np.abs(parts.sum(axis=0) - channel[c]), allowed + 1e-5)
