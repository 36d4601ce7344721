"""Layers of an exported picture add up to it: those of the lights, and those of the light paths."""

from __future__ import annotations

import numpy as np
import OpenImageIO
import pytest
from oracle import rendered_afresh
from sessions import look_of

from relume.exr.layers import layers_of
from relume.exr.picture import export_exr

LIGHTS = {
    "Key": {"kind": "point", "position": [0.5, 1.3, 0.5], "emission": [2.0, 1.5, 1.0]},
    "Fill": {
        "kind": "rectangle", "position": [0.9, 1.2, 0.9], "direction": [-1, -1, -1], "size": [0.5, 0.3],
        "emission": [1.0, 2.0, 4.0],
    },
}  # fmt: skip


@pytest.mark.parametrize("background", ["map", "color"])
def test_layers_of_lights_and_of_paths_each_sum_to_the_picture(gathered, tmp_path, background):
    def change(document):
        document["lights"].update(LIGHTS)
        document["environment"].update(scale=0.7, rotation=30.0)
        document["background"].update(kind=background, color=[0.2, 0.3, 0.1])

    look = look_of(gathered, change)
    layers = layers_of(look, reflects=True)
    told: list[float] = []
    path = tmp_path / "a.exr"
    export_exr(
        path, lambda of, progress: rendered_afresh(gathered, of, progress=progress), look, layers, {},
        progress=told.append,
    )  # fmt: skip
    assert told == sorted(told)
    assert told[-1] == 1.0
    buffer = OpenImageIO.ImageBuf(str(path))
    pixels, names = buffer.get_pixels(OpenImageIO.FLOAT), buffer.spec().channelnames
    channel = {name: pixels[..., k] for k, name in enumerate(names)}
    for group in ("light_", "path_"):
        of_group = [layer.name for layer in layers if layer.name.startswith(group)]
        assert len(of_group) == 3 + (group == "light_" and background == "color")
        for c in "RGB":
            parts = np.array([channel[f"{name}.{c}"] for name in of_group])
            assert np.all(parts.reshape(len(parts), -1).max(axis=1) > 0.01)
            # each value is rounded to eleven bits, the smallest of halves to 2^-25
            allowed = 2**-11 * (channel[c] + parts.sum(axis=0)) + 2**-23
            np.testing.assert_array_less(np.abs(parts.sum(axis=0) - channel[c]), allowed + 1e-5)
